//! The fleet without a server: leases, expiry, handing back, copies.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use karst_core::film::{Film, Round, SampleRange, TileGrid};
use karst_core::scene::{Assets, Document, Folder, Limits, Overrides, Scene};

use super::{Caller, Fleet, Found, Refusal, WorkerStanding};
use crate::farm::live::{Live, LiveFrame, Merged};
use crate::farm::queue::{Queue, Task};
use crate::past::{Past, Trouble};
use crate::state::StoredLease;
use crate::telemetry::Telemetry;
use crate::telemetry::traces::Taken;

const SCENE: &str = r#"{ "version": 1, "film": {"width": 64, "height": 64},
  "camera": {"type": "perspective", "vfov": 40, "transform":
    {"look_at": {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0]}}},
  "sampling": {"spp": 2}, "materials": {"clay": {"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}},
  "spheres": {"ball": {"center": [0, 0, 0], "radius": 1, "material": "clay"}} }"#;

fn frame() -> Arc<LiveFrame> {
    let limits = Limits::default();
    let document = Document::parse(SCENE, "scene.json", &limits).unwrap();
    let assets = Assets::load(&document, &Folder::new(std::path::Path::new(".")).unwrap(), &limits).unwrap();
    let mut description = document.at(1).unwrap();
    description.apply(&Overrides::default(), &limits).unwrap();
    let scene = Arc::new(Scene::build(&description, &assets, 1).unwrap());
    let grid = TileGrid::new(scene.window(), 16);
    let merged = Merged {
        film: Film::new(scene.size(), scene.window(), 0.0),
        rounds: vec![0; grid.tile_count() as usize],
        complete: false,
        stored: None,
        packs: Vec::new(),
        round: 0,
        version: 0,
        accepted: BTreeMap::new(),
        disputes: BTreeMap::new(),
    };
    Arc::new(LiveFrame::new((1, Arc::from("j"), 1), scene, grid, merged))
}

struct Setup {
    queue: Arc<Queue>,
    live: Live,
    frame: Arc<LiveFrame>,
    fleet: Fleet,
}

/// A fleet of no workers and the 16 tasks of a round.
fn setup(ttl: Duration, earlier: Vec<StoredLease>) -> Setup {
    let (queue, live, frame) = (Arc::new(Queue::default()), Live::default(), frame());
    let blocks = vec![SampleRange { a: 0..1, b: 0..1 }; frame.grid.block_count() as usize];
    let round = Arc::new(Round { index: 0, blocks });
    let tiles: Vec<u32> = (0..frame.grid.tile_count()).collect();
    frame.begin_round(Arc::clone(&round), &tiles);
    live.insert(Arc::clone(&frame));
    queue.push(tiles.into_iter().map(|tile| Task {
        frame: Arc::clone(&frame),
        round: Arc::clone(&round),
        tile,
        past: Past::default(),
        taken: Taken::default(),
    }));
    let fleet = Fleet::new(Arc::clone(&queue), 0, ttl, (3, earlier), Arc::new(Telemetry::off()));
    Setup { queue, live, frame, fleet }
}

fn caller(worker: &str, sequence: u64, held: &[u64]) -> Caller {
    Caller {
        worker: worker.into(),
        display_name: worker.into(),
        threads: 2,
        draining: false,
        sequence,
        held: held.iter().copied().collect::<BTreeSet<_>>(),
    }
}

const LONG: Duration = Duration::from_mins(1);

#[tokio::test]
async fn a_lease_is_repeated_until_its_worker_lists_it() {
    let s = setup(LONG, Vec::new());
    s.fleet.present(&caller("a", 1, &[])).unwrap();
    let lease = s.fleet.grant("a", 2).unwrap();
    assert_eq!((lease.fence >> 32, lease.tasks.len(), s.queue.len()), (3, 2, 14));
    assert!(s.fleet.standing(&caller("a", 2, &[]), &s.live).missing.is_empty(), "it is not stored yet");
    s.fleet.stored(lease.fence);
    assert_eq!(s.fleet.standing(&caller("a", 2, &[]), &s.live).missing[0].fence, lease.fence);
    let standing = s.fleet.standing(&caller("a", 3, &[lease.fence, 99]), &s.live);
    assert!(standing.missing.is_empty());
    assert_eq!(standing.revoked, [99], "a lease that nobody knows");
}

#[tokio::test]
async fn a_result_is_found_only_by_the_worker_that_holds_the_task() {
    let s = setup(LONG, Vec::new());
    s.fleet.present(&caller("a", 1, &[])).unwrap();
    let lease = s.fleet.grant("a", 2).unwrap();
    let find = |worker: &str, fence, tile| s.fleet.find(worker, fence, tile, &s.live);
    assert!(matches!(find("a", lease.fence, 0), Found::Task(task) if task.tile == 0));
    assert!(matches!(find("b", lease.fence, 0), Found::Never));
    assert!(matches!(find("a", lease.fence, 9), Found::Never));
    assert!(matches!(find("a", lease.fence + 1, 0), Found::Never));
    s.frame.merged().round = 1;
    assert!(matches!(find("a", lease.fence, 0), Found::Closed));
}

#[tokio::test]
async fn a_silent_worker_loses_what_it_began_and_its_late_result_still_counts() {
    let s = setup(Duration::ZERO, Vec::new());
    s.fleet.present(&caller("a", 1, &[])).unwrap();
    let pace = s.fleet.grant("a", 2).unwrap();
    s.fleet.done("a", pace.fence, &pace.tasks[0], Some(0.001));
    s.fleet.done("a", pace.fence, &pace.tasks[1], Some(0.001));
    let lease = s.fleet.grant("a", 2).unwrap();
    assert!(lease.tasks.len() > 2, "it is fast: {}", lease.tasks.len());
    let troubles = s.fleet.sweep();
    let lost = troubles.iter().filter(|(_, _, t)| matches!(t, Trouble::Lost { .. })).count();
    assert_eq!((troubles.len(), lost), (lease.tasks.len(), 2), "one a thread was begun");
    assert!(s.fleet.sweep().is_empty(), "each loss is told once");
    assert!(matches!(s.fleet.find("a", lease.fence, lease.tasks[0].tile, &s.live), Found::Task(_)));
    assert!(s.fleet.standing(&caller("a", 2, &[lease.fence]), &s.live).revoked.contains(&lease.fence));
}

#[tokio::test]
async fn a_draining_worker_gives_back_what_it_does_not_list() {
    let s = setup(LONG, Vec::new());
    s.fleet.present(&caller("a", 1, &[])).unwrap();
    let (one, two) = (s.fleet.grant("a", 1).unwrap(), s.fleet.grant("a", 1).unwrap());
    let draining = Caller { draining: true, ..caller("a", 2, &[one.fence]) };
    s.fleet.present(&draining).unwrap();
    let standing = s.fleet.standing(&draining, &s.live);
    assert_eq!(standing.returned.len(), two.tasks.len());
    assert!(s.fleet.grant("a", 1).is_none(), "it gets nothing new");
}

#[tokio::test]
async fn the_roster_says_who_is_there() {
    let s = setup(Duration::ZERO, Vec::new());
    for worker in ["a", "b", "c", "d"] {
        s.fleet.present(&caller(worker, 1, &[])).unwrap();
    }
    let lease = s.fleet.grant("a", 2).unwrap();
    s.fleet.block("b", "why");
    let roster = || s.fleet.roster().into_iter().map(|m| (m.worker, m.standing, m.tasks)).collect::<Vec<_>>();
    let (tasks, alive) = (lease.tasks.len(), WorkerStanding::Alive);
    let named = |worker: &str, standing, tasks| (worker.to_owned(), standing, tasks);
    let (a, b, d) = (named("a", alive, tasks), named("b", WorkerStanding::Blocked, 0), named("d", alive, 0));
    assert_eq!(roster(), [a, b.clone(), named("c", alive, 0), d]);
    s.fleet.present(&Caller { draining: true, ..caller("c", 2, &[]) }).unwrap();
    assert_eq!(roster()[2], named("c", WorkerStanding::Draining, 0));
    s.fleet.sweep();
    let lost = |worker: &str| named(worker, WorkerStanding::Lost, 0);
    assert_eq!(roster(), [lost("a"), b, lost("d")], "c has left as it said");
}

#[tokio::test]
async fn old_requests_and_blocked_workers_are_refused() {
    let s = setup(LONG, Vec::new());
    s.fleet.present(&caller("a", 5, &[])).unwrap();
    assert_eq!(s.fleet.present(&caller("a", 5, &[])), Err(Refusal::Superseded));
    let lease = s.fleet.grant("a", 2).unwrap();
    assert_eq!(s.fleet.block("a", "why").len(), lease.tasks.len());
    assert_eq!(s.fleet.present(&caller("a", 6, &[])), Err(Refusal::Blocked("why".into())));
    assert!(s.fleet.grant("a", 2).is_none());
}

#[tokio::test]
async fn a_worker_that_survived_the_server_goes_on_with_its_lease() {
    let earlier = StoredLease {
        fence: (2 << 32) + 7,
        worker: "a".into(),
        job: "j".into(),
        frame: 1,
        round: 0,
        tiles: vec![4, 5],
    };
    let s = setup(LONG, vec![earlier.clone(), StoredLease { fence: 8, frame: 9, ..earlier.clone() }]);
    s.fleet.present(&caller("a", 1, &[])).unwrap();
    assert!(matches!(s.fleet.find("a", 8, 4, &s.live), Found::Later), "its frame is not ready");
    let standing = s.fleet.standing(&caller("a", 1, &[earlier.fence, 8]), &s.live);
    assert!(standing.revoked.is_empty() && standing.missing.is_empty());
    assert_eq!(s.queue.len(), 14, "nobody else gets them");
    assert!(matches!(s.fleet.find("a", earlier.fence, 5, &s.live), Found::Task(_)));
    assert!(matches!(s.fleet.find("b", earlier.fence, 5, &s.live), Found::Never));
}

#[tokio::test]
async fn idle_workers_copy_what_takes_too_long() {
    let s = setup(Duration::from_millis(600), Vec::new());
    for worker in ["a", "b", "c"] {
        s.fleet.present(&caller(worker, 1, &[])).unwrap();
    }
    let mut slow = Vec::new();
    while let Some(lease) = s.fleet.grant("a", 2) {
        slow.extend(lease.tasks);
        if s.queue.len() <= 6 {
            break;
        }
    }
    while !s.queue.is_empty() {
        let lease = s.fleet.grant("b", 2).unwrap();
        lease.tasks.iter().for_each(|t| s.fleet.done("b", lease.fence, t, Some(0.1)));
    }
    assert!(s.fleet.grant("b", 2).is_none(), "nothing is slow yet");
    tokio::time::sleep(Duration::from_millis(100)).await;
    let copy = s.fleet.grant("b", 2).unwrap();
    assert_eq!(copy.tasks.len(), 1);
    assert!(slow.iter().any(|t| t.is_same(&copy.tasks[0])));
    let other = s.fleet.grant("c", 2).unwrap();
    assert!(!other.tasks[0].is_same(&copy.tasks[0]), "two are enough for one task");
}
