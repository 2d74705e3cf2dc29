//! Client of the karst render service: submit, watch, fetch; reconnects and resumes by itself.
//!
//! ```no_run
//! # async fn example() -> Result<(), Box<dyn std::error::Error>> {
//! use futures::StreamExt;
//! use karst_client::{Bearer, Client, Update};
//!
//! let client = Client::connect("http://127.0.0.1:7878", None, Bearer::read("token".as_ref())?).await?;
//! let mut updates = std::pin::pin!(client.watch("job-id", None));
//! while let Some(update) = updates.next().await {
//!     if let Update::Event(event) = update? {
//!         println!("{event:?}");
//!     }
//! }
//! # Ok(())
//! # }
//! ```

mod blob;
mod client;
mod download;
mod error;
mod retry;
mod scene_files;
mod upload;
mod watch;

pub use blob::Blob;
pub use client::Client;
pub use download::Download;
pub use error::Error;
pub use karst_proto::connect::Bearer;
pub use scene_files::{OpenScene, SceneFiles, open_scene, read_scene, scene_error};
pub use upload::Uploaded;
pub use watch::{Update, is_final};

/// Where a server listens unless told otherwise.
pub const DEFAULT_SERVER: &str = "http://127.0.0.1:7878";
