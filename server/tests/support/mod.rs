//! What the tests share: a server on port 0, calls through the generated client, the same picture rendered locally.

#![allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "shared by tests, each uses its part")]

pub mod program;
pub mod raw;

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use karst_core::film::Film;
use karst_core::render::{FrameObserver, render_frame};
use karst_core::scene::{Assets, Document, Folder, Limits, Overrides, Scene};
use karst_proto::connect::{Bearer, Line};
use karst_proto::v1::assets_client::AssetsClient;
use karst_proto::v1::frames_client::FramesClient;
use karst_proto::v1::jobs_client::JobsClient;
use karst_proto::v1::previews_client::PreviewsClient;
use karst_proto::v1::upload_request::Part;
use karst_proto::v1::workers_client::WorkersClient;
use karst_proto::v1::{self, job_event};
use karst_server::config::{Collector, Config};
use karst_server::digest::Digest;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::Channel;
use tonic::{Code, Status};

/// The only asset of the scene, at `meshes/floor.obj`.
pub const FLOOR: &str = "v -4 0 -4\nv 4 0 -4\nv 4 0 4\nv -4 0 4\nf 1 4 3\nf 1 3 2\n";
/// Where it lies.
pub const FLOOR_PATH: &str = "meshes/floor.obj";

/// A lit sphere over a floor; `sampling` and `animation` are parts of the document.
pub fn scene_text(size: (u32, u32), sampling: &str, animation: &str) -> String {
    let (width, height) = size;
    format!(
        r#"{{ "version": 1,
  "camera": {{"type": "perspective", "vfov": 40,
    "transform": {{"look_at": {{"eye": [0, 1.5, 5], "target": [0, 0.7, 0], "up": [0, 1, 0]}}}}}},
  "film": {{"width": {width}, "height": {height}, "filter": {{"type": "gaussian", "radius": 1.5}}}},
  "sampling": {sampling},
  "materials": {{"clay": {{"type": "diffuse", "reflectance": [0.6, 0.4, 0.3]}}}},
  "meshes": {{"floor": {{"file": "{FLOOR_PATH}"}}}},
  "instances": {{"floor": {{"mesh": "floor", "material": "clay"}}}},
  "spheres": {{"ball": {{"center": [0, 0.7, 0], "radius": 0.7, "material": "clay"}},
    "lamp": {{"center": [1, 3, 1], "radius": 0.4, "material": "clay", "emission": [20, 18, 15]}}}},
  "lights": {{"sky": {{"type": "environment", "radiance": [0.1, 0.15, 0.3]}}}}{animation} }}"#
    )
}

/// Part of a document: the lamp fades over `last` frames.
pub fn fading(last: i32) -> String {
    format!(
        r#", "animation": {{"fps": 24, "frames": [1, {last}], "tracks": {{"spheres.lamp.emission":
        {{"interpolation": "linear", "keys": [{{"frame": 1, "value": [20, 18, 15]}}, {{"frame": {last}, "value": [2, 2, 9]}}]}}}}}}"#
    )
}

/// How long the servers of the tests wait for a worker that is not heard of.
pub const LEASE: Duration = Duration::from_secs(2);

/// What a server of the tests is told.
pub fn config(data: &Path, workers: usize) -> Config {
    Config {
        data: data.to_owned(),
        workers,
        lease: LEASE,
        tls: None,
        tokens_file: None,
        collector: Collector::default(),
        state: None,
    }
}

/// The local token of a data folder.
pub fn token_of(data: &Path) -> String {
    std::fs::read_to_string(data.join("token")).unwrap()
}

/// A server in this process.
pub struct TestServer {
    pub url: String,
    /// The local one, which may do everything.
    pub token: String,
    stop: Option<oneshot::Sender<()>>,
    served: tokio::task::JoinHandle<Result<(), karst_server::error::Error>>,
}

impl TestServer {
    pub async fn start(data: &Path, workers: usize) -> Self {
        Self::start_with(config(data, workers)).await
    }

    pub async fn start_with(config: Config) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let data = config.data.clone();
        let (stop, stopped) = oneshot::channel::<()>();
        let (ready, is_ready) = oneshot::channel();
        let served = tokio::spawn(async move {
            let ready = move || {
                let _ = ready.send(());
            };
            karst_server::serve(listener, config, ready, async move { drop(stopped.await) }).await
        });
        is_ready.await.expect("the server starts");
        Self { url, token: token_of(&data), stop: Some(stop), served }
    }

    pub async fn client(&self) -> Client {
        Client::connect(&self.url, &self.token).await
    }

    /// Ends the server and waits until everything is closed.
    pub async fn stop(mut self) {
        drop(self.stop.take());
        tokio::time::timeout(Duration::from_secs(20), self.served).await.expect("it ends").unwrap().unwrap();
    }
}

/// The generated clients.
#[derive(Clone)]
pub struct Client {
    pub channel: Line,
    pub assets: AssetsClient<Line>,
    pub jobs: JobsClient<Line>,
    pub frames: FramesClient<Line>,
    pub previews: PreviewsClient<Line>,
    pub workers: WorkersClient<Line>,
}

impl Client {
    pub async fn connect(url: &str, token: &str) -> Self {
        Self::over(Channel::from_shared(url.to_owned()).unwrap().connect().await.unwrap(), token)
    }

    /// Over a connection that is there.
    pub fn over(channel: Channel, token: &str) -> Self {
        let channel = InterceptedService::new(channel, Bearer::new(token).unwrap());
        Self {
            assets: AssetsClient::new(channel.clone()),
            jobs: JobsClient::new(channel.clone()),
            frames: FramesClient::new(channel.clone()),
            previews: PreviewsClient::new(channel.clone()),
            workers: WorkersClient::new(channel.clone()).max_encoding_message_size(4 << 20),
            channel,
        }
    }

    pub async fn upload(&mut self, bytes: &[u8]) -> String {
        let digest = Digest::of(bytes).to_string();
        let start = v1::UploadStart { digest: digest.clone(), total_size: bytes.len() as u64, offset: 0 };
        let mut parts = vec![Part::Start(start)];
        parts.extend(bytes.chunks(200_000).map(|chunk| Part::Chunk(chunk.to_vec().into())));
        let answer = self.send(parts).await.unwrap();
        assert!(answer.complete, "{answer:?}");
        digest
    }

    pub async fn send(&mut self, parts: Vec<Part>) -> Result<v1::UploadResponse, Status> {
        let messages = parts.into_iter().map(|part| v1::UploadRequest { part: Some(part) });
        let stream = tokio_stream::iter(messages.collect::<Vec<_>>());
        Ok(self.assets.upload(stream).await?.into_inner())
    }

    /// Uploads the scene and its floor; a spec with default settings.
    pub async fn spec(&mut self, text: &str) -> v1::JobSpec {
        let file = v1::SceneFile { path: FLOOR_PATH.to_owned(), digest: self.upload(FLOOR.as_bytes()).await };
        let digest = self.upload(text.as_bytes()).await;
        v1::JobSpec { scene: Some(v1::Scene { digest, files: vec![file] }), ..v1::JobSpec::default() }
    }

    pub async fn submit(&mut self, request_id: &str, spec: &v1::JobSpec) -> Result<v1::Job, Status> {
        let request = v1::SubmitJobRequest {
            request_id: request_id.to_owned(),
            validate_only: false,
            job: Some(spec.clone()),
        };
        Ok(self.jobs.submit_job(request).await?.into_inner())
    }

    pub async fn job(&mut self, job: &str) -> v1::Job {
        self.jobs.get_job(v1::GetJobRequest { job: job.to_owned() }).await.unwrap().into_inner()
    }

    /// Watches from a token to the end: all events with revisions of their own, and the final job.
    pub async fn watch(&mut self, job: &str, token: &str) -> Result<(Vec<v1::JobEvent>, v1::Job), Status> {
        let request = v1::WatchJobRequest { job: job.to_owned(), resume_token: token.to_owned() };
        let mut stream = self.jobs.watch_job(request).await?.into_inner();
        let (mut events, mut last) = (Vec::new(), None);
        while let Some(event) = stream.message().await? {
            if let Some(job_event::Event::Snapshot(job)) = &event.event {
                last = Some(job.clone());
            }
            if is_record(&event) {
                events.push(event);
            }
        }
        Ok((events, last.expect("the last message is a snapshot")))
    }

    pub async fn finish(&mut self, job: &str) -> v1::Job {
        let watched = tokio::time::timeout(Duration::from_mins(2), self.watch(job, ""));
        watched.await.expect("it ends").unwrap().1
    }

    pub async fn frame_list(&mut self, job: &str) -> Vec<v1::Frame> {
        let request = v1::ListFramesRequest { job: job.to_owned(), ..v1::ListFramesRequest::default() };
        self.frames.list_frames(request).await.unwrap().into_inner().frames
    }

    /// All tiles of a frame, put together: R, G, B of each pixel of the window.
    pub async fn collect(&mut self, job: &str, frame: i32) -> Result<Vec<f32>, Status> {
        let request = v1::CollectTilesRequest { job: job.to_owned(), frame, resume_token: String::new() };
        let mut stream = self.frames.collect_tiles(request).await?.into_inner();
        let mut tiles = Vec::new();
        while let Some(tile) = stream.message().await? {
            tiles.push(tile);
        }
        let regions: Vec<_> = tiles.iter().map(|t| t.region.unwrap()).collect();
        let left = regions.iter().map(|r| r.x0).min().unwrap();
        let top = regions.iter().map(|r| r.y0).min().unwrap();
        let width = regions.iter().map(|r| r.x1).max().unwrap() - left;
        let height = regions.iter().map(|r| r.y1).max().unwrap() - top;
        let mut pixels = vec![f32::NAN; (width * height * 3) as usize];
        for (tile, r) in tiles.iter().zip(&regions) {
            let values = tile.rgb_f32.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()));
            let places =
                (r.y0..r.y1).flat_map(|y| (r.x0..r.x1).flat_map(move |x| (0..3).map(move |c| (x, y, c))));
            for ((x, y, c), value) in places.zip(values) {
                let place = &mut pixels[(((y - top) * width + x - left) * 3 + c) as usize];
                assert!(place.is_nan(), "a pixel came twice");
                *place = value;
            }
        }
        assert!(pixels.iter().all(|v| !v.is_nan()), "a pixel is missing");
        Ok(pixels)
    }

    /// A file of a finished frame from `offset` on, and its announced size and digest.
    pub async fn download(
        &mut self,
        job: &str,
        frame: i32,
        format: v1::FrameFormat,
        offset: u64,
    ) -> Result<(v1::DownloadStart, Vec<u8>), Status> {
        use v1::download_frame_response::Part;
        let request = v1::DownloadFrameRequest { job: job.to_owned(), frame, format: format.into(), offset };
        let mut stream = self.frames.download_frame(request).await?.into_inner();
        let (mut start, mut bytes) = (None, Vec::new());
        while let Some(message) = stream.message().await? {
            match message.part.unwrap() {
                Part::Start(s) => start = Some(s),
                Part::Chunk(chunk) => bytes.extend(chunk),
            }
        }
        Ok((start.unwrap(), bytes))
    }
}

/// Events that are told once, each with the next revision.
pub fn is_record(event: &v1::JobEvent) -> bool {
    use job_event::Event::{Frame, Round, Snapshot};
    matches!(event.event, Some(Snapshot(_) | Frame(_) | Round(_)))
}

struct Quiet;

impl FrameObserver for Quiet {}

/// The same frame without a server: R, G, B of each pixel.
pub fn render_locally(text: &str, frame: i32, overrides: &Overrides, tile_size: u32) -> Vec<f32> {
    let scene = build_locally(text, frame, overrides);
    let film = render_frame(&scene, tile_size, &AtomicBool::new(false), &Quiet).unwrap();
    colors(&film)
}

/// The scene of a frame.
pub fn build_locally(text: &str, frame: i32, overrides: &Overrides) -> Scene {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("meshes")).unwrap();
    std::fs::write(dir.path().join(FLOOR_PATH), FLOOR).unwrap();
    let limits = Limits::default();
    let document = Document::parse(text, "scene.json", &limits).unwrap();
    let assets = Assets::load(&document, &Folder::new(dir.path()).unwrap(), &limits).unwrap();
    let mut description = document.at(frame).unwrap();
    description.apply(overrides, &limits).unwrap();
    Scene::build(&description, &assets, frame).unwrap()
}

/// R, G, B of each pixel of a film.
pub fn colors(film: &Film) -> Vec<f32> {
    film.picture().color.iter().flat_map(glam::Vec3::to_array).collect()
}

/// SHA-256 over the bits of the floats.
pub fn hash(values: &[f32]) -> Digest {
    Digest::of(&values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>())
}

/// A random but readable request id.
pub fn request_id(name: &str) -> String {
    format!("{name}-{}", uuid::Uuid::new_v4())
}

/// The code and the reason of an error that karst made.
pub fn refusal<T: std::fmt::Debug>(result: Result<T, Status>) -> (Code, String) {
    let status = result.expect_err("an error");
    let reason = karst_proto::errors::reason(&status).map(|r| r.as_str_name().to_owned());
    assert!(status.details().len() < 4096, "{} bytes of details", status.details().len());
    (status.code(), reason.unwrap_or_default())
}
