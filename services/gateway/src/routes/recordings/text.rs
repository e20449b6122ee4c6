//! A recording as CSV, made of its MCAP file when it is asked for.

use std::path::{Path, PathBuf};
use std::time::Duration;

use axum::body::Body;
use kort_recording::{Format, Recording};
use tokio::io::AsyncWriteExt;
use tokio::sync::{Semaphore, SemaphorePermit};
use tokio::time::timeout;
use tokio_util::io::ReaderStream;

use super::{blocking, unreadable};
use crate::problem::{Kind, Problem};

/// It is made in memory, of a file of 256 MiB about a gigabyte: one is made and sent at a time, or a reader with many
/// requests would end the gateway, and the thrust with it.
static TURN: Semaphore = Semaphore::const_new(1);
/// How long a request waits for its turn; no request takes longer than 10 s in all.
const TURN_WITHIN: Duration = Duration::from_secs(5);
/// A reader that takes nothing for so long loses the rest, and its turn.
const READER_PATIENCE: Duration = Duration::from_secs(10);
/// What is handed to the connection at once, bytes.
const PART: usize = 64 << 10;

/// Length in bytes, and the text on its way.
pub async fn csv(path: PathBuf) -> Result<(usize, Body), Problem> {
    let turn = timeout(TURN_WITHIN, TURN.acquire()).await.ok().and_then(Result::ok).ok_or_else(|| {
        Problem::new(Kind::Overloaded, "other recordings are being sent as CSV, one at a time")
            .hint("try again, or fetch the `.mcap`, which is sent as it is")
    })?;
    // The turn goes along: whoever asked may be gone before the text is made.
    let (text, turn) = blocking(move || made(&path).map(|text| (text, turn))).await??;
    Ok((text.len(), sent(text, turn, READER_PATIENCE)))
}

fn made(path: &Path) -> Result<Vec<u8>, Problem> {
    let recording = Recording::read(path, None).map_err(nothing_yet)?;
    let mut text = std::io::Cursor::new(Vec::new());
    recording.write(Format::Csv, &mut text).map_err(|error| unreadable(path, error))?;
    Ok(text.into_inner())
}

/// A recording that has just begun has no complete chunk, and one that a killed process left may have none at all.
fn nothing_yet(error: impl std::fmt::Display) -> Problem {
    Problem::new(Kind::UnknownRecording, format!("nothing of it can be read: {error}"))
        .hint("a running recording is written within a second; as `.mcap` the file is sent as it is")
}

/// Part after part, as the reader takes them; the turn ends with the last one, or with the reader's patience.
fn sent(text: Vec<u8>, turn: SemaphorePermit<'static>, patience: Duration) -> Body {
    let (mut to, from) = tokio::io::duplex(PART);
    tokio::spawn(async move {
        let _turn = turn;
        for part in text.chunks(PART) {
            if !matches!(timeout(patience, to.write_all(part)).await, Ok(Ok(()))) {
                return;
            }
        }
    });
    Body::from_stream(ReaderStream::with_capacity(from, PART))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn one_is_sent_at_a_time_and_who_does_not_read_loses_its_turn() {
        static TURN: Semaphore = Semaphore::const_new(1);
        let text = vec![b'1'; 5 * PART + 7];
        let turn = TURN.acquire().await.unwrap();
        let body = sent(text.clone(), turn, Duration::from_secs(60));
        assert!(TURN.try_acquire().is_err(), "it is being sent");
        assert_eq!(axum::body::to_bytes(body, usize::MAX).await.unwrap(), text, "all of it");
        let turn =
            timeout(Duration::from_secs(20), TURN.acquire()).await.expect("the next one's turn").unwrap();
        let unread = sent(text.clone(), turn, Duration::from_millis(20));
        let next = timeout(Duration::from_secs(20), TURN.acquire()).await;
        assert!(next.is_ok(), "nobody waits for one who does not read");
        assert!(
            axum::body::to_bytes(unread, usize::MAX).await.unwrap().len() < text.len(),
            "the rest is lost"
        );
    }
}
