//! A recording as CSV or Parquet, made of its MCAP file when it is asked for.

use std::future::Future;
use std::io;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::body::Body;
use kort_recording::{Format, Recording};
use tokio::io::{AsyncRead, AsyncWriteExt, DuplexStream, ReadBuf};
use tokio::sync::{Semaphore, SemaphorePermit};
use tokio::time::timeout;
use tokio_util::io::ReaderStream;

use super::{blocking, unreadable};
use crate::problem::{Kind, Problem};

/// It is made in memory, of a file of 256 MiB about a gigabyte: one is made and sent at a time, or a reader with many
/// requests would end the gateway, and the thrust with it.
static TURN: Semaphore = Semaphore::const_new(1);
/// How long a request waits for its turn, and for the text before its answer begins without it; an answer begins within
/// 10 s in all.
const TURN_WITHIN: Duration = Duration::from_secs(5);
const MADE_WITHIN: Duration = Duration::from_secs(3);
/// A reader that takes nothing for so long loses the rest, and its turn.
const READER_PATIENCE: Duration = Duration::from_secs(10);
/// What is handed to the connection at once, bytes.
const PART: usize = 64 << 10;

/// A text, and the turn that ends with it.
type Made = (Vec<u8>, SemaphorePermit<'static>);

/// The turn of whoever makes something of a recording.
pub async fn turn() -> Result<SemaphorePermit<'static>, Problem> {
    timeout(TURN_WITHIN, TURN.acquire()).await.ok().and_then(Result::ok).ok_or_else(|| {
        Problem::new(Kind::Overloaded, "other recordings are being made into CSV or Parquet, one at a time")
            .hint("try again, or fetch the `.mcap`, which is sent as it is")
    })
}

/// Length in bytes, where the text was made at once, and the text on its way.
pub async fn other(path: PathBuf, format: Format) -> Result<(Option<usize>, Body), Problem> {
    let turn = turn().await?;
    // The turn goes along: whoever asked may be gone before the text is made.
    let mut making = Box::pin(blocking(move || made(&path, format).map(|text| (text, turn))));
    match timeout(MADE_WITHIN, &mut making).await {
        Ok(made) => {
            let made = made??;
            Ok((Some(made.0.len()), sent(async { Some(made) }, READER_PATIENCE)))
        }
        Err(_) => Ok((None, sent(async { making.await.ok()?.ok() }, READER_PATIENCE))),
    }
}

fn made(path: &Path, format: Format) -> Result<Vec<u8>, Problem> {
    let recording = Recording::read(path, None).map_err(nothing_yet)?;
    let mut text = std::io::Cursor::new(Vec::new());
    recording.write(format, &mut text).map_err(|error| unreadable(path, error))?;
    Ok(text.into_inner())
}

/// A recording that has just begun has no complete chunk, and one that a killed process left may have none at all.
pub fn nothing_yet(error: impl std::fmt::Display) -> Problem {
    Problem::new(Kind::UnknownRecording, format!("nothing of it can be read: {error}"))
        .hint("a running recording is written within a second; as `.mcap` the file is sent as it is")
}

/// Part after part, as the reader takes them; the turn ends with the last one, or with the reader's patience.
fn sent(made: impl Future<Output = Option<Made>> + Send + 'static, patience: Duration) -> Body {
    let (mut to, from) = tokio::io::duplex(PART);
    let whole = Arc::new(AtomicBool::new(false));
    let text = OnItsWay { from, whole: Arc::clone(&whole) };
    tokio::spawn(async move {
        let Some((text, _turn)) = made.await else { return };
        for part in text.chunks(PART) {
            if !matches!(timeout(patience, to.write_all(part)).await, Ok(Ok(()))) {
                return;
            }
        }
        whole.store(true, Ordering::Release);
    });
    Body::from_stream(ReaderStream::with_capacity(text, PART))
}

/// What is sent, as the connection reads it: an end before the end is an error, and ends the connection, so that nobody
/// takes a part for the whole.
struct OnItsWay {
    from: DuplexStream,
    whole: Arc<AtomicBool>,
}

impl AsyncRead for OnItsWay {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        ready!(Pin::new(&mut self.from).poll_read(cx, buffer))?;
        if buffer.filled().len() == before && !self.whole.load(Ordering::Acquire) {
            return Poll::Ready(Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the rest is not sent")));
        }
        Poll::Ready(Ok(()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn one_is_sent_at_a_time_and_who_does_not_read_loses_its_turn() {
        static TURN: Semaphore = Semaphore::const_new(1);
        let text = vec![b'1'; 5 * PART + 7];
        let made = |turn| (text.clone(), turn);
        let first = made(TURN.acquire().await.unwrap());
        let body = sent(async { Some(first) }, Duration::from_secs(60));
        assert!(TURN.try_acquire().is_err(), "it is being sent");
        assert_eq!(axum::body::to_bytes(body, usize::MAX).await.unwrap(), text, "all of it");
        let turn = timeout(Duration::from_secs(20), TURN.acquire()).await.expect("the next one's turn");
        let second = made(turn.unwrap());
        let unread = sent(async { Some(second) }, Duration::from_millis(20));
        let next = timeout(Duration::from_secs(20), TURN.acquire()).await;
        assert!(next.is_ok(), "nobody waits for one who does not read");
        assert!(axum::body::to_bytes(unread, usize::MAX).await.is_err(), "a part is not taken for the whole");
        let failed = sent(async { None }, Duration::from_secs(60));
        assert!(axum::body::to_bytes(failed, usize::MAX).await.is_err(), "nor is nothing");
    }
}
