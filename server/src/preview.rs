//! Owns who watches pixels, and how pixels look on the wire.
//!
//! A viewer is a set of tiles that changed since it last looked, never a queue of pictures: however slow it is, it
//! costs one small set, gets the newest state of each tile, and rendering never waits for it. Pixels are taken
//! from the film at the moment they are sent.

use std::collections::{BTreeSet, HashMap};
use std::ops::Bound;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use glam::Vec3;
use karst_core::film::Picture;
use karst_proto::convert::rgb_f16;
use tokio::sync::Notify;

/// All viewers of all jobs.
#[derive(Debug, Default)]
pub struct Hub {
    viewers: Mutex<HashMap<String, Vec<Weak<Viewer>>>>,
}

/// Somebody who watches some frames of a job.
#[derive(Debug)]
pub struct Viewer {
    /// `None` means all frames.
    frames: Option<BTreeSet<i32>>,
    news: Mutex<News>,
    changed: Notify,
}

#[derive(Debug, Default)]
struct News {
    tiles: BTreeSet<(i32, u32)>,
    /// Where the last look ended: tiles take turns, so that busy ones do not starve the others.
    turn: (i32, u32),
    ended: bool,
}

impl Hub {
    /// A new viewer of a job; it is forgotten when it is dropped.
    pub fn attach(&self, job: &str, frames: Option<BTreeSet<i32>>) -> Arc<Viewer> {
        let viewer = Arc::new(Viewer { frames, news: Mutex::default(), changed: Notify::new() });
        let mut viewers = self.lock();
        // Whoever left a job that nothing happens to any more is forgotten here.
        viewers.retain(|_, of_job| {
            of_job.retain(|v| v.strong_count() > 0);
            !of_job.is_empty()
        });
        viewers.entry(job.to_owned()).or_default().push(Arc::downgrade(&viewer));
        viewer
    }

    /// Tiles of a frame have changed.
    pub fn publish(&self, job: &str, frame: i32, tiles: &[u32]) {
        self.each(job, |viewer| viewer.mark(frame, tiles.iter().copied()));
    }

    /// Frames of the job will not change any more: whoever looks at these alone has seen everything.
    pub fn end_frames(&self, job: &str, frames: &[i32]) {
        let is_over = |viewer: &Viewer| {
            viewer.frames.as_ref().is_some_and(|wanted| wanted.iter().all(|frame| frames.contains(frame)))
        };
        self.each(job, |viewer| {
            if is_over(viewer) {
                viewer.end();
            }
        });
    }

    /// Nothing of the job will change any more.
    pub fn end(&self, job: &str) {
        self.each(job, Viewer::end);
    }

    /// Viewers that are there, of all jobs.
    pub fn viewers(&self) -> usize {
        self.lock().values().flatten().filter(|viewer| viewer.strong_count() > 0).count()
    }

    fn each(&self, job: &str, tell: impl Fn(&Viewer)) {
        let mut viewers = self.lock();
        let Some(of_job) = viewers.get_mut(job) else { return };
        of_job.retain(|viewer| viewer.upgrade().inspect(|v| tell(v)).is_some());
        if of_job.is_empty() {
            viewers.remove(job);
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Vec<Weak<Viewer>>>> {
        self.viewers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What a viewer has to do next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// Send the newest state of this tile: frame, tile.
    Tile(i32, u32),
    /// Nothing will come any more.
    End,
}

impl Viewer {
    /// Tiles of a frame are worth a look.
    pub fn mark(&self, frame: i32, tiles: impl IntoIterator<Item = u32>) {
        if self.frames.as_ref().is_some_and(|wanted| !wanted.contains(&frame)) {
            return;
        }
        self.lock().tiles.extend(tiles.into_iter().map(|tile| (frame, tile)));
        self.changed.notify_one();
    }

    /// Nothing will change any more.
    pub fn end(&self) {
        self.lock().ended = true;
        self.changed.notify_one();
    }

    /// Waits for something to do.
    pub async fn next(&self) -> Next {
        loop {
            if let Some(next) = self.take() {
                return next;
            }
            self.changed.notified().await;
        }
    }

    fn take(&self) -> Option<Next> {
        let mut news = self.lock();
        let after = (Bound::Excluded(news.turn), Bound::Unbounded);
        let next = news.tiles.range(after).next().or_else(|| news.tiles.first()).copied();
        if let Some(tile) = next {
            news.tiles.remove(&tile);
            news.turn = tile;
            return Some(Next::Tile(tile.0, tile.1));
        }
        news.ended.then_some(Next::End)
    }

    fn lock(&self) -> MutexGuard<'_, News> {
        self.news.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Which layer of the picture a viewer sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// Linear colours.
    Color,
    /// Albedo of the first surface.
    Albedo,
    /// Normal of the first surface.
    Normal,
}

/// A layer as half floats, reduced.
#[derive(Debug, PartialEq, Eq)]
pub struct HalfPicture {
    /// Elements across.
    pub width: u32,
    /// Elements down.
    pub height: u32,
    /// R, G, B of each element, little endian, row by row.
    pub rgb: Vec<u8>,
}

/// A layer of `picture`; an element is the mean of 2^`level` × 2^`level` pixels.
pub fn half_picture(picture: &Picture, layer: Layer, level: u32) -> HalfPicture {
    let pixels = match layer {
        Layer::Color => &picture.color,
        Layer::Albedo => &picture.albedo,
        Layer::Normal => &picture.normal,
    };
    let (columns, rows) = (picture.window.width(), picture.window.height());
    let step = 1 << level;
    let (width, height) = (columns.div_ceil(step), rows.div_ceil(step));
    let at = |y: u32, x: u32| pixels[(y * columns + x) as usize];
    let mean = |y: u32, x: u32| {
        let xs = x * step..((x + 1) * step).min(columns);
        let ys = y * step..((y + 1) * step).min(rows);
        let count = (xs.len() * ys.len()) as f32;
        (ys.flat_map(|y| xs.clone().map(move |x| (y, x))).map(|(y, x)| at(y, x)).sum::<Vec3>() / count)
            .to_array()
    };
    let elements = (0..height).flat_map(|y| (0..width).map(move |x| (y, x)));
    HalfPicture { width, height, rgb: rgb_f16(elements.map(|(y, x)| mean(y, x))) }
}

#[cfg(test)]
mod tests {
    use super::{Hub, Layer, Next, half_picture};
    use glam::Vec3;
    use karst_core::film::{FrameSize, Picture, Region};
    use std::collections::BTreeSet;

    #[tokio::test]
    async fn a_slow_viewer_gets_each_tile_once_and_in_turns() {
        let hub = Hub::default();
        let viewer = hub.attach("j", None);
        for _ in 0..1000 {
            hub.publish("j", 1, &[0, 1, 2]);
        }
        assert_eq!(viewer.next().await, Next::Tile(1, 0));
        hub.publish("j", 1, &[0]);
        assert_eq!(viewer.next().await, Next::Tile(1, 1), "tile 0 has had its turn");
        assert_eq!(viewer.next().await, Next::Tile(1, 2));
        assert_eq!(viewer.next().await, Next::Tile(1, 0));
        hub.publish("other", 1, &[5]);
        hub.end("j");
        assert_eq!(viewer.next().await, Next::End);
    }

    #[tokio::test]
    async fn a_viewer_sees_only_the_frames_it_asked_for() {
        let hub = Hub::default();
        let viewer = hub.attach("j", Some(BTreeSet::from([2])));
        hub.publish("j", 1, &[0]);
        hub.publish("j", 2, &[7]);
        hub.end("j");
        assert_eq!((viewer.next().await, viewer.next().await), (Next::Tile(2, 7), Next::End));
    }

    #[tokio::test]
    async fn the_end_of_its_frames_is_the_end_for_a_viewer() {
        let hub = Hub::default();
        let one = hub.attach("j", Some(BTreeSet::from([1])));
        let two = hub.attach("j", Some(BTreeSet::from([1, 2])));
        let all = hub.attach("j", None);
        hub.publish("j", 1, &[0]);
        hub.end_frames("j", &[1]);
        assert_eq!((one.next().await, one.next().await), (Next::Tile(1, 0), Next::End));
        assert_eq!((two.take(), two.take()), (Some(Next::Tile(1, 0)), None));
        hub.end_frames("j", &[1, 2]);
        assert_eq!((two.take(), all.take(), all.take()), (Some(Next::End), Some(Next::Tile(1, 0)), None));
    }

    #[test]
    fn viewers_that_left_are_forgotten() {
        let hub = Hub::default();
        drop(hub.attach("j", None));
        hub.publish("j", 1, &[0]);
        assert!(hub.lock().is_empty());
        drop(hub.attach("k", None));
        drop(hub.attach("l", None));
        assert_eq!(hub.lock().keys().collect::<Vec<_>>(), ["l"]);
    }

    #[test]
    fn a_level_is_a_mean_over_what_is_there() {
        let window = Region { x0: 0, y0: 0, x1: 3, y1: 1 };
        let color = vec![Vec3::splat(1.0), Vec3::splat(3.0), Vec3::splat(1e9)];
        let picture = Picture {
            size: FrameSize { width: 3, height: 1 },
            window,
            albedo: vec![Vec3::ZERO; 3],
            normal: vec![Vec3::ZERO; 3],
            depth: vec![0.0; 3],
            samples: vec![1.0; 3],
            error: vec![0.0; 3],
            evaluations: Vec::new(),
            color,
        };
        let half = half_picture(&picture, Layer::Color, 1);
        assert_eq!((half.width, half.height, half.rgb.len()), (2, 1, 12));
        let bits = |i: usize| u16::from_le_bytes([half.rgb[2 * i], half.rgb[2 * i + 1]]);
        assert_eq!((bits(0), bits(3)), (0x4000, 0x7bff), "2 and the largest half, not infinity");
        assert_eq!(half_picture(&picture, Layer::Albedo, 8).rgb, [0; 6]);
    }
}
