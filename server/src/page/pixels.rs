//! Owns what the page gets to see: the tiles of a frame, and the exact values of a pixel.

use std::collections::BTreeSet;

use karst_core::film::Region;
use tokio::sync::watch::Receiver;

use crate::error::Error;
use crate::farm::{Shared, prepare};
use crate::page::messages::{Answer, Found, FrameInfo, Probe, Tell, Values, Watch, tile_message};
use crate::page::socket::{Ended, Outlet};
use crate::view::View;

/// Coarsest level of detail.
const MAX_LEVEL: u32 = 8;

/// Sends the tiles of a frame until nothing changes any more.
pub(super) async fn send_tiles(shared: &Shared, watch: &Watch, outlet: &Outlet) -> Result<(), Ended> {
    if watch.level > MAX_LEVEL {
        let text = format!("found {}, expected 0 to {MAX_LEVEL}", watch.level);
        return Err(Error::field("level", text).into());
    }
    let mut view = View::open(shared, &watch.job, Some(BTreeSet::from([watch.frame]))).await?;
    outlet.send(Tell::Frame(describe(shared, watch).await?).into()).await?;
    while let Some(tile) = view.next(shared).await? {
        outlet.send(tile_message(watch, &tile)).await?;
    }
    outlet.send(Tell::End { watch: watch.number }.into()).await
}

async fn describe(shared: &Shared, watch: &Watch) -> Result<FrameInfo, Error> {
    if let Some(live) = shared.live.get(&watch.job, watch.frame) {
        return Ok(FrameInfo::of_scene(watch, &live.scene));
    }
    let spec = shared.state.spec(&watch.job).await?;
    let description = prepare::describe(&shared.blobs, &shared.limits, spec, watch.frame).await?;
    Ok(FrameInfo::of_description(watch, &description))
}

/// Answers the newest question, then waits for the next one.
pub(super) async fn answer_probes(
    shared: &Shared,
    mut questions: Receiver<Option<Probe>>,
    outlet: &Outlet,
) -> Result<(), Ended> {
    while questions.changed().await.is_ok() {
        let Some(probe) = questions.borrow_and_update().clone() else { continue };
        let found = match look(shared, &probe).await {
            Ok(Some(values)) => Found::Pixel { x: probe.x, y: probe.y, values },
            Ok(None) => Found::Nothing { error: "nothing has been rendered here yet".to_owned() },
            Err(e) => Found::Nothing { error: e.to_string() },
        };
        outlet.send(Tell::Probe(Answer { probe: probe.number, found }).into()).await?;
    }
    Ok(())
}

/// The values of a pixel in the newest state of its frame.
async fn look(shared: &Shared, probe: &Probe) -> Result<Option<Values>, Error> {
    let Probe { x, y, .. } = *probe;
    let pixel = Region { x0: x, y0: y, x1: x.saturating_add(1), y1: y.saturating_add(1) };
    let picture = if let Some(live) = shared.live.get(&probe.job, probe.frame) {
        live.merged().film.region(pixel)
    } else {
        shared.state.frame(&probe.job, probe.frame).await?;
        let Some(digest) = shared.state.round(&probe.job, probe.frame).await?.film else { return Ok(None) };
        shared.films.get(digest).await?.region(pixel)
    };
    Ok(Values::of(&picture).filter(|_| picture.samples.first().is_some_and(|samples| *samples > 0.0)))
}
