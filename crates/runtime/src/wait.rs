//! Waiting for what a person does at a line: a cable that is plugged in or pulled.

use std::thread;
use std::time::{Duration, Instant};

/// Time from one look to the next.
const LOOK: Duration = Duration::from_millis(200);

/// Looks every 200 ms, at least once, until there is something or the patience is at its end; `None` then.
pub fn look_until<T>(patience: Duration, mut look: impl FnMut() -> Option<T>) -> Option<T> {
    let until = Instant::now() + patience;
    loop {
        if let Some(found) = look() {
            return Some(found);
        }
        if Instant::now() >= until {
            return None;
        }
        thread::sleep(LOOK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_patience_it_is_looked_once_and_what_is_found_ends_the_wait() {
        let mut looks = 0;
        let nothing: Option<()> = look_until(Duration::ZERO, || {
            looks += 1;
            None
        });
        assert_eq!((nothing, looks), (None, 1));
        let third = look_until(Duration::from_secs(600), || {
            looks += 1;
            (looks == 3).then_some(looks)
        });
        assert_eq!(third, Some(3));
    }
}
