//! The tev image viewer: a connection that pictures are pushed into.
//!
//! tev never answers. What can be known of it is that it takes bytes, has stopped taking them, or is gone.

use std::io::{self, ErrorKind, Read};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use karst_client::Error;
use karst_core::film::{FrameSize, Region};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};
use tokio::sync::{mpsc, watch};
use tokio::task::{JoinHandle, spawn_blocking};

/// Packets between the caller and the connection; beyond them the caller waits until tev has taken one.
const PACKETS: usize = 2;
/// How long tev may take to accept the connection.
const GREETING: Duration = Duration::from_secs(5);

/// How tev goes when somebody closes its window.
const CLOSED: &str = "closed the connection";

/// Names of the channels of a layer, as tev shows them.
pub(crate) type Channels = &'static [&'static str];

/// A connection to tev.
#[derive(Debug)]
pub(crate) struct Tev {
    address: String,
    packets: mpsc::Sender<Packet>,
    /// How tev went; empty while it is there.
    gone: watch::Receiver<String>,
    writer: JoinHandle<Result<(), String>>,
    _line: Line,
}

/// Closes the connection for all who read or write it.
#[derive(Debug)]
struct Line(TcpStream);

impl Drop for Line {
    fn drop(&mut self) {
        let _ = self.0.shutdown(Shutdown::Both);
    }
}

#[derive(Debug)]
enum Packet {
    Create { image: Arc<str>, size: FrameSize, channels: Vec<&'static str> },
    Update { image: Arc<str>, channels: Channels, region: Region, values: Vec<f32> },
}

impl Tev {
    /// Connects to the tev that listens at `address`, HOST:PORT. One that takes nothing for `patience` counts as gone.
    ///
    /// # Errors
    /// [`Error::Viewer`] when nobody listens there.
    pub(crate) async fn connect(address: &str, patience: Duration) -> Result<Self, Error> {
        let line = dial(address, patience)
            .await
            .map_err(|cause| Error::Viewer { address: address.to_owned(), cause })?;
        let clone = || line.0.try_clone().map_err(|e| Error::Failed(format!("tev at {address}: {e}")));
        let (reader, socket) = (clone()?, clone()?);
        let (packets, waiting) = mpsc::channel(PACKETS);
        let (tell, gone) = watch::channel(String::new());
        let told = tell.clone();
        spawn_blocking(move || told.send_replace(hear(reader)));
        let writer = spawn_blocking(move || {
            push(waiting, socket)
                .map_err(|error| how(&error, patience))
                .inspect_err(|how| drop(tell.send_replace(how.clone())))
        });
        Ok(Self { address: address.to_owned(), packets, gone, writer, _line: line })
    }

    /// Opens a black picture, in place of one of the same name, and brings it to the front.
    ///
    /// # Errors
    /// tev is gone.
    pub(crate) async fn create(
        &self,
        image: &Arc<str>,
        size: FrameSize,
        channels: Vec<&'static str>,
    ) -> Result<(), Error> {
        self.send(Packet::Create { image: Arc::clone(image), size, channels }).await
    }

    /// Replaces the pixels of a region: the values of all channels of the first pixel, of the second, row by row.
    ///
    /// # Errors
    /// tev is gone; there are more or fewer values than the region has.
    pub(crate) async fn update(
        &self,
        image: &Arc<str>,
        channels: Channels,
        region: Region,
        values: Vec<f32>,
    ) -> Result<(), Error> {
        let expected = region.area() * channels.len();
        if expected == 0 || values.len() != expected {
            let found = values.len();
            return Err(Error::Failed(format!(
                "{image}: {region:?} came with {found} values, expected {expected}"
            )));
        }
        self.send(Packet::Update { image: Arc::clone(image), channels, region, values }).await
    }

    /// Waits until tev is gone and says how it went.
    pub(crate) async fn gone(&self) -> Error {
        let mut gone = self.gone.clone();
        let how = gone.wait_for(|how| !how.is_empty()).await.map(|how| how.clone()).unwrap_or_default();
        lost(&self.address, &how)
    }

    /// Ends the connection when everything is on its way.
    ///
    /// # Errors
    /// tev is gone.
    pub(crate) async fn finish(self) -> Result<(), Error> {
        drop(self.packets);
        match self.writer.await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(how)) => Err(lost(&self.address, &how)),
            Err(error) => Err(lost(&self.address, &error.to_string())),
        }
    }

    async fn send(&self, packet: Packet) -> Result<(), Error> {
        tokio::select! {
            biased;
            error = self.gone() => Err(error),
            sent = self.packets.send(packet) => match sent {
                Ok(()) => Ok(()),
                Err(_) => Err(self.gone().await),
            },
        }
    }
}

async fn dial(address: &str, patience: Duration) -> Result<Line, String> {
    let connected = tokio::time::timeout(GREETING, tokio::net::TcpStream::connect(address)).await;
    let text = |error: io::Error| error.to_string().to_lowercase();
    let stream = match connected {
        Ok(stream) => stream.and_then(tokio::net::TcpStream::into_std).map_err(text)?,
        Err(_) => return Err(format!("no answer within {} s", GREETING.as_secs())),
    };
    stream.set_nonblocking(false).map_err(text)?;
    stream.set_nodelay(true).map_err(text)?;
    stream.set_write_timeout(Some(patience)).map_err(text)?;
    Ok(Line(stream))
}

/// Waits until the connection ends; whatever else comes is of no interest.
fn hear(mut socket: TcpStream) -> String {
    let mut ignored = [0; 64];
    while socket.read(&mut ignored).is_ok_and(|count| count > 0) {}
    CLOSED.to_owned()
}

fn push(mut packets: mpsc::Receiver<Packet>, socket: TcpStream) -> io::Result<()> {
    let mut tev = TevClient::wrap(socket);
    while let Some(packet) = packets.blocking_recv() {
        match packet {
            Packet::Create { image, size, channels } => tev.send(PacketCreateImage {
                image_name: &image,
                grab_focus: true,
                width: size.width,
                height: size.height,
                channel_names: &channels,
            })?,
            Packet::Update { image, channels, region, values } => {
                let count = channels.len() as u64;
                tev.send(PacketUpdateImage {
                    image_name: &image,
                    grab_focus: false,
                    channel_names: channels,
                    channel_offsets: &(0..count).collect::<Vec<_>>(),
                    channel_strides: &vec![count; channels.len()],
                    x: region.x0,
                    y: region.y0,
                    width: region.width(),
                    height: region.height(),
                    data: &values,
                })?;
            }
        }
    }
    Ok(())
}

/// What a failed write says of tev.
fn how(error: &io::Error, patience: Duration) -> String {
    let is_one_of = |kinds: [ErrorKind; 2]| kinds.contains(&error.kind());
    if is_one_of([ErrorKind::WouldBlock, ErrorKind::TimedOut]) {
        format!("has taken nothing for {} s", patience.as_secs_f64())
    } else if is_one_of([ErrorKind::BrokenPipe, ErrorKind::ConnectionReset]) {
        CLOSED.to_owned()
    } else {
        format!("cannot be written to: {error}")
    }
}

fn lost(address: &str, how: &str) -> Error {
    Error::Failed(format!("tev at {address} {how}"))
}

#[cfg(test)]
mod tests {
    use super::Tev;
    use karst_core::film::{FrameSize, Region};
    use std::net::TcpListener;
    use std::time::Duration;

    #[tokio::test]
    async fn a_tev_that_takes_nothing_is_given_up() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let tev = Tev::connect(&address, Duration::from_millis(200)).await.unwrap();
        let _silent = listener.accept().unwrap();
        let region = FrameSize { width: 512, height: 512 }.region();
        let error = loop {
            let values = vec![0.5; region.area()];
            if let Err(error) = tev.update(&"a".into(), &["Y"], region, values).await {
                break error;
            }
        };
        assert_eq!(error.to_string(), format!("tev at {address} has taken nothing for 0.2 s"));
        assert_eq!(tev.finish().await.unwrap_err().to_string(), error.to_string());
    }

    #[tokio::test]
    async fn values_that_do_not_fit_are_not_sent() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let tev =
            Tev::connect(&listener.local_addr().unwrap().to_string(), Duration::from_secs(9)).await.unwrap();
        let region = Region { x0: 1, y0: 1, x1: 3, y1: 2 };
        for count in [0, 5, 7] {
            assert!(tev.update(&"a".into(), &["R", "G", "B"], region, vec![0.0; count]).await.is_err());
        }
        let empty = Region { x1: 1, ..region };
        assert!(tev.update(&"a".into(), &["R"], empty, vec![]).await.is_err());
        tev.update(&"a".into(), &["R", "G", "B"], region, vec![0.0; 6]).await.unwrap();
        tev.finish().await.unwrap();
    }
}
