//! Frames from anywhere into the diagnosis.

use linesman_diagnosis::{Direction, Engine, FrameSeen, Setup};
use linesman_proto::address::Network;
use linesman_proto::time::{Instant, Span};

use crate::series::series;

/// Whatever is seen on a line, the diagnosis judges it without harm, and its answer is one JSON
/// object whose confidences are between 0 and 1.
pub fn diagnosis(data: &[u8]) {
    let mut engine = Engine::new(Setup::default());
    let mut now = Instant::ZERO;
    for (number, item) in series(data).enumerate() {
        now += Span::us(item.pause_us);
        let direction = match item.flags % 3 {
            0 => Direction::Sent,
            1 => Direction::Received,
            _ => Direction::Unknown,
        };
        engine.handle_frame(&FrameSeen {
            network: Network(item.flags >> 6),
            path: None,
            direction,
            time: now,
            number: number as u64 + 1,
            fcs: None,
            truncated: item.flags & 0x04 != 0,
            probe: None,
            bytes: item.bytes,
        });
        if item.flags & 0x08 != 0 {
            engine.handle_timeout(now);
        }
        while engine.poll_event().is_some() {}
        while engine.poll_probe().is_some() {}
    }
    engine.finish(now, true);
    let json = serde_json::to_value(engine.diagnosis()).expect("the answer can be written");
    let findings = json["findings"].as_array().expect("findings are a list");
    for finding in findings {
        let confidence = finding["confidence"].as_f64().expect("a confidence is a number");
        assert!((0.0..=1.0).contains(&confidence), "{finding}");
    }
}
