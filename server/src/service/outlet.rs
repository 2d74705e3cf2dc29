//! Owns how streams are sent: a few messages in flight, readers that stop reading are sent away.

use std::pin::Pin;
use std::time::Duration;

use futures::Stream;
use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_util::sync::CancellationToken;
use tonic::Status;

use crate::error::Error;

/// A reader that takes nothing for so long is closed.
const PATIENCE: Duration = Duration::from_secs(30);
/// Messages in flight.
const IN_FLIGHT: usize = 4;

/// What a streaming call returns.
pub(crate) type Outflow<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

/// The sending end of a stream.
#[derive(Debug)]
pub(crate) struct Outlet<T> {
    sender: mpsc::Sender<T>,
    patience: Duration,
}

/// Why nothing more can be sent.
#[derive(Debug)]
pub(crate) enum Closed {
    /// The reader has left.
    Gone,
    /// The stream ends with this error.
    Error(Error),
}

impl From<Error> for Closed {
    fn from(error: Error) -> Self {
        Self::Error(error)
    }
}

impl<T> Outlet<T> {
    /// Sends a message when the reader has room for it.
    pub(crate) async fn send(&self, message: T) -> Result<(), Closed> {
        match timeout(self.patience, self.sender.send(message)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) => Err(Closed::Gone),
            Err(_) => Err(Error::SlowConsumer.into()),
        }
    }

    /// Resolves when the reader has left.
    pub(crate) async fn gone(&self) {
        self.sender.closed().await;
    }
}

/// A stream that `produce` fills. It ends with OK when `produce` ends well, else with its error; also when the
/// server ends, or when the reader takes nothing for 30 s.
pub(crate) fn stream<T, F, P>(ending: &CancellationToken, produce: P) -> Outflow<T>
where
    T: Send + 'static,
    F: Future<Output = Result<(), Closed>> + Send,
    P: FnOnce(Outlet<T>) -> F + Send + 'static,
{
    stream_with(ending, PATIENCE, produce)
}

fn stream_with<T, F, P>(ending: &CancellationToken, patience: Duration, produce: P) -> Outflow<T>
where
    T: Send + 'static,
    F: Future<Output = Result<(), Closed>> + Send,
    P: FnOnce(Outlet<T>) -> F + Send + 'static,
{
    let (sender, mut receiver) = mpsc::channel(IN_FLIGHT);
    let ending = ending.clone();
    let task = tokio::spawn(async move {
        tokio::select! {
            result = produce(Outlet { sender, patience }) => result,
            () = ending.cancelled() => Err(Error::Unavailable("the server is ending: connect again").into()),
        }
    });
    Box::pin(async_stream::stream! {
        while let Some(message) = receiver.recv().await {
            yield Ok(message);
        }
        match task.await {
            Ok(Ok(()) | Err(Closed::Gone)) => {}
            Ok(Err(Closed::Error(error))) => yield Err(error.into()),
            Err(e) => yield Err(Error::from(e).into()),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::{stream, stream_with};
    use crate::error::Error;
    use futures::StreamExt;
    use std::time::Duration;
    use tokio_util::sync::CancellationToken;
    use tonic::Code;

    #[tokio::test]
    async fn a_reader_that_stops_reading_gets_what_was_sent_and_an_error() {
        let patience = Duration::from_millis(20);
        let mut stream = stream_with(&CancellationToken::new(), patience, |outlet| async move {
            for i in 0..100 {
                outlet.send(i).await?;
            }
            Ok(())
        });
        tokio::time::sleep(patience * 10).await;
        let mut received = 0;
        let error = loop {
            match stream.next().await.unwrap() {
                Ok(_) => received += 1,
                Err(status) => break status,
            }
        };
        assert_eq!((received, error.code()), (4, Code::ResourceExhausted));
    }

    #[tokio::test]
    async fn the_end_of_the_server_ends_streams() {
        let ending = CancellationToken::new();
        let mut waiting = stream::<u8, _, _>(&ending, |outlet| async move {
            outlet.gone().await;
            Ok(())
        });
        ending.cancel();
        assert_eq!(waiting.next().await.unwrap().unwrap_err().code(), Code::Unavailable);
        let mut failing =
            stream::<u8, _, _>(&CancellationToken::new(), |_outlet| async move { Err(Error::Token.into()) });
        assert_eq!(failing.next().await.unwrap().unwrap_err().code(), Code::InvalidArgument);
        assert!(failing.next().await.is_none());
    }
}
