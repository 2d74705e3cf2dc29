//! Owns the messages of `karst.page.v1`; what they mean stands in `page/PROTOCOL.md`.

use axum::extract::ws::Message;
use karst_core::color::View;
use karst_core::film::{Picture, Region};
use karst_core::scene::{Description, Goal, Scene};
use serde::{Deserialize, Serialize};

use crate::farm::feed::Progress;
use crate::model::{Frame, FrameState, Job, JobState};
use crate::preview::{Layer, half_picture};
use crate::view::TileState;

/// What the page asks for.
#[derive(Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum Ask {
    /// The tiles of a frame.
    Watch(Watch),
    /// No more tiles.
    Unwatch,
    /// The frames of a job.
    Frames {
        /// The job's id.
        job: String,
    },
    /// The values of one pixel.
    Probe(Probe),
}

/// The tiles of a frame, now and whenever they improve.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub(super) struct Watch {
    /// All answers carry it.
    #[serde(rename = "watch")]
    pub number: u32,
    pub job: String,
    pub frame: i32,
    pub layer: LayerName,
    /// An element is the mean of 2^level × 2^level pixels.
    pub level: u32,
}

/// The values of one pixel of a frame.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub(super) struct Probe {
    /// The answer carries it.
    #[serde(rename = "probe")]
    pub number: u32,
    pub job: String,
    pub frame: i32,
    pub x: u32,
    pub y: u32,
}

/// A layer, as the page calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum LayerName {
    Color,
    Albedo,
    Normal,
}

impl From<LayerName> for Layer {
    fn from(name: LayerName) -> Self {
        match name {
            LayerName::Color => Self::Color,
            LayerName::Albedo => Self::Albedo,
            LayerName::Normal => Self::Normal,
        }
    }
}

/// What the page is told.
#[derive(Debug, Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum Tell<'a> {
    Jobs { jobs: Vec<JobLine<'a>> },
    Frames { job: &'a str, frames: Vec<FrameLine<'a>> },
    Frame(FrameInfo),
    Progress(ProgressLine<'a>),
    Probe(Answer),
    End { watch: u32 },
    Error { watch: Option<u32>, error: String, hint: String },
}

impl From<Tell<'_>> for Message {
    fn from(tell: Tell<'_>) -> Self {
        // Plain data with text keys always has a JSON form.
        Self::text(serde_json::to_string(&tell).unwrap_or_default())
    }
}

#[derive(Debug, Serialize)]
pub(super) struct JobLine<'a> {
    id: &'a str,
    name: &'a str,
    state: JobState,
    frames_total: u32,
    frames_finished: u32,
    error: Option<&'a str>,
    submitted_at: f64,
}

impl<'a> JobLine<'a> {
    pub(super) fn of(job: &'a Job) -> Self {
        Self {
            id: &job.id,
            name: &job.spec.display_name,
            state: job.state,
            frames_total: job.frames_total,
            frames_finished: job.frames_finished,
            error: job.failure.as_ref().map(|failure| failure.message.as_str()),
            submitted_at: job.submitted_at as f64 / 1e6,
        }
    }
}

#[derive(Debug, Serialize)]
pub(super) struct FrameLine<'a> {
    frame: i32,
    state: FrameState,
    rounds: u32,
    spp: f64,
    rel_mse: Option<f64>,
    denoised_rel_mse: Option<f64>,
    seconds: f64,
    error: Option<&'a str>,
}

impl<'a> FrameLine<'a> {
    pub(super) fn of(frame: &'a Frame) -> Self {
        Self {
            frame: frame.frame,
            state: frame.state,
            rounds: frame.rounds,
            spp: frame.spp,
            rel_mse: frame.rel_mse,
            denoised_rel_mse: frame.denoised.map(|error| error.rel_mse),
            seconds: frame.seconds,
            error: frame.failure.as_ref().map(|failure| failure.message.as_str()),
        }
    }
}

/// What is watched.
#[derive(Debug, Serialize)]
pub(super) struct FrameInfo {
    watch: u32,
    frame: i32,
    width: u32,
    height: u32,
    window: [u32; 4],
    exposure: f32,
    view: &'static str,
    spp_goal: Option<u32>,
    target_error: Option<f64>,
}

impl FrameInfo {
    /// Of a frame that is being rendered.
    pub(super) fn of_scene(watch: &Watch, scene: &Scene) -> Self {
        let (size, window) = (scene.size(), scene.window());
        let (spp_goal, target_error) = goal(scene.sampling().goal);
        Self {
            watch: watch.number,
            frame: watch.frame,
            width: size.width,
            height: size.height,
            window: [window.x0, window.y0, window.x1, window.y1],
            exposure: scene.exposure(),
            view: name_of(scene.view()),
            spp_goal,
            target_error,
        }
    }

    /// Of a frame as the document describes it.
    pub(super) fn of_description(watch: &Watch, description: &Description) -> Self {
        let film = &description.film;
        let window = film.window();
        let (spp_goal, target_error) = goal(description.sampling.goal);
        Self {
            watch: watch.number,
            frame: watch.frame,
            width: film.width,
            height: film.height,
            window: [window.x, window.y, window.x + window.width, window.y + window.height],
            exposure: film.exposure,
            view: name_of(film.view),
            spp_goal,
            target_error,
        }
    }
}

fn goal(goal: Goal) -> (Option<u32>, Option<f64>) {
    match goal {
        Goal::Fixed { spp } => (Some(spp), None),
        Goal::Error { target, max_spp, .. } => (Some(max_spp), Some(target)),
    }
}

fn name_of(view: View) -> &'static str {
    match view {
        View::Standard => "standard",
        View::Filmic => "filmic",
    }
}

#[derive(Debug, Serialize)]
pub(super) struct ProgressLine<'a> {
    job: &'a str,
    frame: i32,
    samples_done: u64,
    samples_planned: u64,
    samples_per_second: f64,
    rel_mse: Option<f64>,
    seconds_left: Option<f64>,
}

impl<'a> ProgressLine<'a> {
    pub(super) fn of(job: &'a str, progress: &Progress) -> Self {
        Self {
            job,
            frame: progress.frame,
            samples_done: progress.samples_done,
            samples_planned: progress.samples_planned,
            samples_per_second: progress.samples_per_second,
            rel_mse: progress.rel_mse,
            seconds_left: progress.seconds_left,
        }
    }
}

/// The answer to a probe.
#[derive(Debug, Serialize)]
pub(super) struct Answer {
    pub probe: u32,
    #[serde(flatten)]
    pub found: Found,
}

/// What a probe found.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(super) enum Found {
    Pixel { x: u32, y: u32, values: Values },
    Nothing { error: String },
}

/// The exact floats of a pixel; those that are not finite become `null`.
#[derive(Debug, Serialize)]
#[serde(rename_all = "PascalCase")]
pub(super) struct Values {
    color: [f32; 3],
    albedo: [f32; 3],
    normal: [f32; 3],
    depth: [f32; 1],
    samples: [f32; 1],
    error: [f32; 1],
}

impl Values {
    /// Of the first pixel of a picture.
    pub(super) fn of(picture: &Picture) -> Option<Self> {
        Some(Self {
            color: picture.color.first()?.to_array(),
            albedo: picture.albedo.first()?.to_array(),
            normal: picture.normal.first()?.to_array(),
            depth: [*picture.depth.first()?],
            samples: [*picture.samples.first()?],
            error: [*picture.error.first()?],
        })
    }
}

/// A tile: a header of 32 bytes, then half floats, all little endian.
pub(super) fn tile_message(watch: &Watch, tile: &TileState) -> Message {
    let half = half_picture(&tile.picture, watch.layer.into(), watch.level);
    let Region { x0, y0, x1, y1 } = tile.picture.window;
    let mut bytes = Vec::with_capacity(32 + half.rgb.len());
    for number in [watch.number, x0, y0, x1, y1, half.width, half.height] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(tile.spp().to_le_bytes());
    bytes.extend(half.rgb);
    Message::binary(bytes)
}

#[cfg(test)]
mod tests {
    use super::{Answer, Ask, Found, LayerName, Tell, Values, Watch};
    use axum::extract::ws::Message;
    use serde_json::{Value, json};

    fn ask(text: &Value) -> Result<Ask, serde_json::Error> {
        serde_json::from_str(&text.to_string())
    }

    fn told(tell: Tell<'_>) -> Value {
        match Message::from(tell) {
            Message::Text(text) => serde_json::from_str(&text).unwrap(),
            other @ (Message::Binary(_) | Message::Ping(_) | Message::Pong(_) | Message::Close(_)) => {
                panic!("{other:?}")
            }
        }
    }

    #[test]
    fn questions_are_read_as_the_protocol_has_them() {
        let found = ask(
            &json!({"type": "watch", "watch": 7, "job": "j", "frame": 12, "layer": "Albedo", "level": 2, "new": 1}),
        );
        let watch = Watch { number: 7, job: "j".to_owned(), frame: 12, layer: LayerName::Albedo, level: 2 };
        assert_eq!(found.unwrap(), Ask::Watch(watch));
        assert_eq!(ask(&json!({"type": "unwatch"})).unwrap(), Ask::Unwatch);
        assert!(ask(&json!({"type": "watch", "watch": -1})).is_err());
        assert!(ask(&json!({"type": "dance"})).is_err() && ask(&json!(7)).is_err());
    }

    #[test]
    fn exact_floats_are_the_shortest_decimals_and_others_are_null() {
        let values = Values {
            color: [0.1, 1.0 / 3.0, 1e-30],
            albedo: [f32::NAN, 0.0, 1.0],
            normal: [0.0, 1.0, 0.0],
            depth: [f32::INFINITY],
            samples: [64.0],
            error: [0.01],
        };
        let found = told(Tell::Probe(Answer { probe: 3, found: Found::Pixel { x: 1, y: 2, values } }));
        assert_eq!(found["type"], "probe");
        assert_eq!((&found["x"], &found["values"]["Depth"]), (&json!(1), &json!([null])));
        assert_eq!(found["values"]["Albedo"], json!([null, 0.0, 1.0]));
        assert_eq!(found["values"]["Color"][0].to_string(), "0.1");
        assert_eq!(found["values"]["Color"][1].as_f64().unwrap() as f32, 1.0 / 3.0);
        let none = told(Tell::Probe(Answer { probe: 3, found: Found::Nothing { error: "no".to_owned() } }));
        assert_eq!(none, json!({"type": "probe", "probe": 3, "error": "no"}));
    }
}
