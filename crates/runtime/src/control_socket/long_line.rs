//! Rest of a long line, from whoever sends it steadily.

use std::io::{self, BufRead as _, BufReader, ErrorKind};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

/// Time that a sender has.
#[derive(Clone, Copy, Debug)]
pub(super) struct SendTime {
    /// From one part to the next.
    pub(super) pause: Duration,
    /// For all of it.
    pub(super) whole: Duration,
}

/// Reads up to the end of a line, or until it is longer than `most` bytes; false if that took longer than `time` allows. No
/// read of `stream` ends by itself afterwards.
///
/// # Errors
/// Those of the socket.
pub(super) fn read_rest(
    stream: &UnixStream,
    lines: &mut BufReader<&UnixStream>,
    line: &mut Vec<u8>,
    most: u64,
    time: SendTime,
) -> io::Result<bool> {
    let began = Instant::now();
    while line.len() as u64 <= most {
        // Each part renews the pause alone: a byte now and then would keep the place of others.
        let left = time.whole.saturating_sub(began.elapsed());
        if left.is_zero() {
            return Ok(false);
        }
        stream.set_read_timeout(Some(left.min(time.pause)))?;
        let came = match lines.fill_buf() {
            Ok(came) => came,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return Ok(false);
            }
            Err(error) => return Err(error),
        };
        let end = came.iter().position(|byte| *byte == b'\n');
        let len = end.map_or(came.len(), |at| at + 1);
        line.extend_from_slice(&came[..len]);
        lines.consume(len);
        if end.is_some() || len == 0 {
            break;
        }
    }
    stream.set_read_timeout(None)?;
    Ok(true)
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;
    use std::thread;

    use super::*;

    const MOST: u64 = 1000;

    /// Result of reading what `send` sends, and if that was in time.
    fn read(time: SendTime, send: impl FnOnce(UnixStream) + Send + 'static) -> (bool, Vec<u8>) {
        let (here, there) = UnixStream::pair().unwrap();
        let sender = thread::spawn(move || send(there));
        let mut line = Vec::new();
        let is_whole = read_rest(&here, &mut BufReader::new(&here), &mut line, MOST, time).unwrap();
        drop(here);
        sender.join().unwrap();
        (is_whole, line)
    }

    /// Time for which no host holds a program up.
    const LONG: Duration = Duration::from_secs(600);

    #[test]
    fn line_is_read_to_its_end_its_limit_or_the_end_of_the_connection() {
        let time = SendTime { pause: LONG, whole: LONG };
        let sending =
            |bytes: &'static [u8]| read(time, move |mut there| drop(there.write_all(bytes)));
        assert_eq!(sending(b"one\ntwo\n"), (true, b"one\n".to_vec()));
        assert_eq!(sending(b"one"), (true, b"one".to_vec()));
        let (is_whole, line) = sending(&[b'x'; 5000]);
        assert!(is_whole && line.len() as u64 > MOST);
    }

    #[test]
    fn byte_now_and_then_does_not_keep_the_reader() {
        let trickle = |mut there: UnixStream| {
            while there.write_all(b"x").is_ok() {
                thread::sleep(Duration::from_millis(10));
            }
        };
        let time = SendTime { pause: LONG, whole: Duration::from_millis(200) };
        let (is_whole, line) = read(time, trickle);
        assert!(!is_whole && !line.is_empty() && (line.len() as u64) < MOST);
    }

    #[test]
    fn sender_that_stops_does_not_keep_the_reader() {
        let time = SendTime { pause: Duration::from_millis(20), whole: LONG };
        // It ends when the reader has gone.
        let stop = |mut there: UnixStream| {
            there.write_all(b"x").unwrap();
            let _ = io::Read::read(&mut there, &mut [0]);
        };
        assert_eq!(read(time, stop), (false, b"x".to_vec()));
    }
}
