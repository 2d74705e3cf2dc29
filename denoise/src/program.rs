//! Starts `karst-oidn`, talks to it through its three pipes at once, and says what went wrong.

use std::io::{self, BufReader, Read};
use std::path::Path;
use std::process::{ChildStdin, Command, ExitStatus, Stdio};
use std::thread;

use crate::wire::{Answer, Header, VERSION, WireError, read_answer, write_plane};
use crate::{DenoiseError, Pixel};

/// Bytes kept of what the program writes to its standard error.
const MAX_STDERR: usize = 4096;

/// Runs the program once. Each pipe has its own thread, so neither end can wait for the other for ever.
pub(crate) fn run<T: Pixel>(
    program: &Path,
    header: &Header,
    planes: &[(&str, &[T])],
) -> Result<Vec<[f32; 3]>, DenoiseError> {
    let spawned =
        Command::new(program).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = match spawned {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Err(DenoiseError::ProgramMissing { path: program.to_owned() });
        }
        other => other?,
    };
    let (stdin, stdout, stderr) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
    let (answer, said) = thread::scope(|scope| {
        // What goes wrong while sending shows in the answer: the program says why, or is gone.
        scope.spawn(move || stdin.map(|stdin| send(stdin, header, planes)));
        let said = scope.spawn(move || stderr.map(last_words).unwrap_or_default());
        let answer = match stdout {
            Some(stdout) => read_answer(&mut BufReader::new(stdout), header),
            None => Err(WireError::Io(io::ErrorKind::BrokenPipe.into())),
        };
        if answer.is_err() {
            // A foreign program may write on and on, or wait for more: it has nothing more to say.
            let _ = child.kill();
        }
        (answer, said.join().unwrap_or_default())
    });
    let status = child.wait()?;
    conclude(answer, status, said)
}

fn send<T: Pixel>(mut stdin: ChildStdin, header: &Header, planes: &[(&str, &[T])]) -> io::Result<()> {
    header.write(&mut stdin)?;
    planes.iter().try_for_each(|(_, plane)| write_plane(&mut stdin, plane))
}

/// The last bytes of a stream, as one trimmed text.
fn last_words(mut stream: impl Read) -> String {
    let (mut kept, mut bytes) = (Vec::new(), [0; 1024]);
    while let Ok(count @ 1..) = stream.read(&mut bytes) {
        kept.extend_from_slice(&bytes[..count]);
        kept.drain(..kept.len().saturating_sub(MAX_STDERR));
    }
    String::from_utf8_lossy(&kept).trim().to_owned()
}

/// Makes one result of the answer and the way in which the program ended.
fn conclude(
    answer: Result<Answer, WireError>,
    status: ExitStatus,
    stderr: String,
) -> Result<Vec<[f32; 3]>, DenoiseError> {
    match answer {
        Ok(Answer::Denoised(plane)) => Ok(plane),
        Ok(Answer::Failed(text)) => Err(DenoiseError::Failed(text)),
        Ok(Answer::OtherVersion(found)) => Err(DenoiseError::Version { found, expected: VERSION }),
        // The dynamic loader of glibc and of musl.
        Err(WireError::Io(_))
            if status.code() == Some(127)
                && (stderr.contains("error while loading shared libraries")
                    || stderr.contains("Error loading shared library")) =>
        {
            Err(DenoiseError::LibraryMissing { message: stderr })
        }
        Err(WireError::Io(_)) => Err(DenoiseError::Crashed { status, stderr }),
        Err(error) => Err(DenoiseError::Answer(error)),
    }
}
