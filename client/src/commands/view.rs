//! `karst view`: shows frames in the tev image viewer while they improve, and at the end with their exact values.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use futures::stream::{BoxStream, SelectAll, StreamExt};
use karst_client::{Client, Error, Update, is_final};
use karst_core::encode::{ExrImage, read_exr};
use karst_core::film::{FrameSize, Region, TileGrid};
use karst_proto::convert::{from_f16, region_from_wire};
use karst_proto::v1::job_event::Event;
use karst_proto::v1::{Frame, FrameFormat, FrameState, Job, JobEvent, PreviewTile, StreamTilesRequest};
use serde_json::json;

use crate::args::{LayerArg, ViewArgs};
use crate::talk::Talk;
use crate::tev::Tev;

/// How long tev may take nothing while something waits for it.
const PATIENCE: Duration = Duration::from_mins(1);
/// Edge of the pieces in which exact values are sent.
const PIECE: u32 = 128;

pub(super) async fn run(args: ViewArgs, talk: Talk) -> Result<(), Error> {
    let client = args.server.connect().await?;
    let mut farm = Watched::begin(client, &args.job, talk).await?;
    let frames = chosen(&farm.frames, args.frame, args.follow)?;
    let tev = Tev::connect(&args.tev, PATIENCE).await?;
    let mut layers = args.layer.clone();
    layers.sort_unstable();
    layers.dedup();
    for frame in frames {
        let image = farm.image_name(frame);
        talk.say(&format_args!("frame {frame} is \"{image}\" in tev at {}", args.tev));
        let mut view = View { tev: &tev, layers: &layers, frame, image, size: None, tiles: 0 };
        let finished = view.improve(&mut farm).await?;
        if let Some(error) = &finished.error {
            talk.say(&format_args!("warning: frame {frame}: {}", error.message));
        }
        view.complete(&farm.client, &farm.job.id, talk).await?;
        let line = json!({"event": "viewed", "frame": frame, "image": *view.image, "tiles": view.tiles});
        talk.result(&view.image, &line);
    }
    tev.finish().await
}

/// A job and its frames, as they are by now.
struct Watched {
    client: Client,
    updates: BoxStream<'static, Result<Update, Error>>,
    job: Job,
    frames: BTreeMap<i32, Frame>,
    /// The frames are those of the final job.
    complete: bool,
    connected: bool,
    talk: Talk,
}

impl Watched {
    async fn begin(client: Client, job: &str, talk: Talk) -> Result<Self, Error> {
        let updates = client.watch(job, None).boxed();
        let job = Job { id: job.to_owned(), ..Job::default() };
        let frames = BTreeMap::new();
        let mut watched = Self { client, updates, job, frames, complete: false, connected: true, talk };
        // The watch begins with the job; what happens to a frame after that is not missed.
        while watched.job.spec.is_none() {
            watched.next().await?;
        }
        watched.list().await?;
        Ok(watched)
    }

    async fn list(&mut self) -> Result<(), Error> {
        let frames = self.client.frames(&self.job.id).await?;
        self.frames = frames.into_iter().map(|frame| (frame.frame, frame)).collect();
        Ok(())
    }

    /// Waits for something to happen. May be dropped at any time: what was heard is kept before anything is waited for.
    async fn next(&mut self) -> Result<(), Error> {
        if is_final(self.job.state()) && !self.complete {
            self.list().await?;
            self.complete = true;
            return Ok(());
        }
        match self.updates.next().await.transpose()? {
            Some(Update::Event(event)) => {
                self.connected = true;
                self.take(*event);
            }
            Some(Update::Reconnecting { cause, .. }) => {
                if std::mem::take(&mut self.connected) {
                    self.talk.say(&format_args!("connection lost ({cause}), trying again"));
                }
            }
            None => {
                let text = format!("{}: the watch ended before the frame did", self.job.id);
                return Err(Error::Failed(text));
            }
        }
        Ok(())
    }

    fn take(&mut self, event: JobEvent) {
        match event.event {
            Some(Event::Snapshot(job)) => self.job = job,
            Some(Event::Frame(frame)) => {
                self.frames.insert(frame.frame, frame);
            }
            Some(Event::Round(_) | Event::Progress(_) | Event::Bookmark(_)) | None => {}
        }
    }

    /// What the picture of a frame is called in tev; a name from a stranger may have any characters.
    fn image_name(&self, frame: i32) -> Arc<str> {
        let name = self.job.spec.as_ref().map_or("", |spec| spec.display_name.as_str());
        let name = if name.is_empty() { &self.job.id } else { name };
        format!("{} frame {frame}", name.replace(char::is_control, "_")).into()
    }

    /// The frame when it is finished; an error when it never will be.
    fn finished(&self, number: i32) -> Result<Option<Frame>, Error> {
        let Some(frame) = self.frames.get(&number) else { return Ok(None) };
        match frame.state() {
            FrameState::Finished => Ok(Some(frame.clone())),
            FrameState::Failed => {
                let why = frame.error.as_ref().map_or("no reason given", |error| error.message.as_str());
                Err(Error::Failed(format!("frame {number} failed: {why}")))
            }
            FrameState::Cancelled => Err(Error::Failed(format!("frame {number} was cancelled"))),
            FrameState::Unspecified | FrameState::Pending | FrameState::Rendering | FrameState::Finishing => {
                Ok(None)
            }
        }
    }
}

/// The frames to show, in order: from the `wanted` one on, or from where the job is.
fn chosen(frames: &BTreeMap<i32, Frame>, wanted: Option<i32>, follow: bool) -> Result<Vec<i32>, Error> {
    let begun = |frame: &&Frame| matches!(frame.state(), FrameState::Rendering | FrameState::Finishing);
    let ahead = |frame: &&Frame| frame.state() == FrameState::Pending;
    let now = frames.values().find(begun).or_else(|| frames.values().find(ahead));
    let now = now.or_else(|| frames.values().next()).map(|frame| frame.frame);
    let Some(from) = wanted.or(now).filter(|from| frames.contains_key(from)) else {
        let bounds = frames.keys().next().zip(frames.keys().next_back());
        let (first, last) = bounds.unwrap_or((&0, &0));
        let text = format!(
            "found {}, the job has {} frames from {first} to {last}",
            wanted.unwrap_or(0),
            frames.len()
        );
        return Err(Error::Usage(format!("--frame: {text}")));
    };
    Ok(frames.range(from..).map(|(number, _)| *number).take(if follow { frames.len() } else { 1 }).collect())
}

/// A frame as a picture in tev.
struct View<'a> {
    tev: &'a Tev,
    layers: &'a [LayerArg],
    frame: i32,
    image: Arc<str>,
    /// Of the picture, once it is open.
    size: Option<FrameSize>,
    tiles: u64,
}

impl View<'_> {
    /// Passes tiles on until the frame is finished.
    async fn improve(&mut self, farm: &mut Watched) -> Result<Frame, Error> {
        if let Some(frame) = farm.finished(self.frame)? {
            return Ok(frame);
        }
        let mut tiles = self.tiles(farm);
        loop {
            tokio::select! {
                error = self.tev.gone() => return Err(error),
                update = farm.next() => {
                    update?;
                    if let Some(frame) = farm.finished(self.frame)? {
                        return Ok(frame);
                    }
                }
                Some((layer, tile)) = tiles.next() => self.pass_on(layer, &tile?).await?,
            }
        }
    }

    /// The tiles of all layers that improve with time. While tev is slow nobody takes them, and the server sends
    /// the newest ones later.
    fn tiles(&self, farm: &Watched) -> SelectAll<BoxStream<'static, (LayerArg, Result<PreviewTile, Error>)>> {
        let stream = |layer: &LayerArg| {
            let (layer, wire) = (*layer, layer.preview()?);
            let request = StreamTilesRequest {
                job: farm.job.id.clone(),
                frames: vec![self.frame],
                layer: wire.into(),
                ..StreamTilesRequest::default()
            };
            Some(farm.client.stream_tiles(request).map(move |tile| (layer, tile)).boxed())
        };
        self.layers.iter().filter_map(stream).collect()
    }

    async fn pass_on(&mut self, layer: LayerArg, tile: &PreviewTile) -> Result<(), Error> {
        let (Some(region), Some(size)) = (&tile.region, tile.size) else {
            return Err(Error::Failed(format!("{}: tile {} came without its place", self.image, tile.tile)));
        };
        self.open(FrameSize { width: size.width, height: size.height }).await?;
        let values = from_f16(&tile.rgb_f16).collect();
        self.update(layer, region_from_wire(region), values).await?;
        self.tiles += 1;
        Ok(())
    }

    /// Opens the picture if it is not open yet.
    async fn open(&mut self, size: FrameSize) -> Result<(), Error> {
        if self.size.is_none() {
            let channels = self.layers.iter().flat_map(|layer| layer.channels()).copied().collect();
            self.tev.create(&self.image, size, channels).await?;
            self.size = Some(size);
        }
        Ok(())
    }

    async fn update(&self, layer: LayerArg, region: Region, values: Vec<f32>) -> Result<(), Error> {
        let whole = self.size.map(FrameSize::region);
        if whole.is_none_or(|whole| whole.intersection(&region) != region) {
            return Err(Error::Failed(format!("{}: {region:?} lies outside of the frame", self.image)));
        }
        self.tev.update(&self.image, layer.channels(), region, values).await
    }

    /// Replaces everything by the exact values of the finished frame.
    async fn complete(&mut self, client: &Client, job: &str, talk: Talk) -> Result<(), Error> {
        let bytes = tokio::select! {
            error = self.tev.gone() => return Err(error),
            bytes = client.frame_bytes(job, self.frame, FrameFormat::Exr) => bytes?,
        };
        let wrong = |text: String| Error::Failed(format!("{}: {text}", self.image));
        let image = read_exr(&bytes).map_err(|error| wrong(error.to_string()))?;
        let window =
            window(&image).ok_or_else(|| wrong("its EXR has a window outside of the frame".to_owned()))?;
        self.open(FrameSize { width: image.full.0, height: image.full.1 }).await?;
        let grid = TileGrid::new(window, PIECE);
        for layer in self.layers {
            let planes: Vec<&[f32]> =
                layer.channels().iter().filter_map(|name| image.channel(name)).collect();
            if planes.len() < layer.channels().len() {
                talk.say(&format_args!(
                    "warning: {} has no channels {}",
                    self.image,
                    layer.channels().join(" ")
                ));
                continue;
            }
            for piece in 0..grid.tile_count() {
                let region = grid.tile_region(piece);
                let place = |[x, y]: [u32; 2]| ((y - window.y0) * image.width + x - window.x0) as usize;
                let values =
                    region.pixels().flat_map(|pixel| planes.iter().map(move |plane| plane[place(pixel)]));
                self.update(*layer, region, values.collect()).await?;
            }
        }
        Ok(())
    }
}

/// The part of the frame that a picture covers.
fn window(image: &ExrImage) -> Option<Region> {
    let (x0, y0) = (u32::try_from(image.origin.0).ok()?, u32::try_from(image.origin.1).ok()?);
    Some(Region { x0, y0, x1: x0.checked_add(image.width)?, y1: y0.checked_add(image.height)? })
}

#[cfg(test)]
mod tests {
    use super::{chosen, window};
    use karst_core::encode::ExrImage;
    use karst_core::film::Region;
    use karst_proto::v1::{Frame, FrameState};
    use std::collections::BTreeMap;

    fn frames(states: &[FrameState]) -> BTreeMap<i32, Frame> {
        let frame =
            |number, state: FrameState| Frame { frame: number, state: state.into(), ..Frame::default() };
        (-2..).step_by(2).zip(states).map(|(number, state)| (number, frame(number, *state))).collect()
    }

    #[test]
    fn the_frame_that_is_rendered_is_shown_unless_another_is_wanted() {
        use FrameState::{Finished, Finishing, Pending, Rendering};
        for (states, first) in [
            (vec![Finished, Rendering, Rendering, Pending], 0),
            (vec![Finished, Finishing, Pending, Pending], 0),
            (vec![Finished, Finished, Pending, Pending], 2),
            (vec![Finished; 4], -2),
            (vec![Pending; 4], -2),
        ] {
            assert_eq!(chosen(&frames(&states), None, false).unwrap(), [first], "{states:?}");
        }
        assert_eq!(chosen(&frames(&[Finished, Rendering, Pending]), None, true).unwrap(), [0, 2]);
        assert_eq!(chosen(&frames(&[Finished; 3]), Some(0), true).unwrap(), [0, 2]);
        let error = chosen(&frames(&[Finished; 3]), Some(1), false).unwrap_err();
        assert_eq!(error.to_string(), "--frame: found 1, the job has 3 frames from -2 to 2");
        assert!(chosen(&BTreeMap::new(), None, true).is_err());
    }

    #[test]
    fn a_window_has_no_negative_corner() {
        let image = |origin| ExrImage {
            width: 3,
            height: 2,
            origin,
            full: (9, 9),
            channels: vec![],
            statistics: None,
        };
        assert_eq!(window(&image((1, 4))), Some(Region { x0: 1, y0: 4, x1: 4, y1: 6 }));
        assert_eq!(window(&image((-1, 0))), None);
    }
}
