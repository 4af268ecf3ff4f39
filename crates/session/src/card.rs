//! Counters of a network card, as observations of the host.

use linesman_diagnosis::HostEvent;
use linesman_proto::time::Span;

/// Counts of a card since it was looked at last.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct CardSample {
    /// Presence of a link now.
    pub carrier: bool,
    /// Number of changes of that.
    pub carrier_changes: u64,
    /// Received frames with a wrong check sequence.
    pub crc: u64,
    /// Received frames that were damaged otherwise.
    pub damaged: u64,
    /// Intact frames for which the card had no room.
    pub card_drops: u64,
    /// Frames for which the socket had no room.
    pub socket_drops: u64,
    /// Frames that could not be sent.
    pub send_failures: u64,
    /// The worst delay of a thread that waited for a time, if one was noted.
    pub latest_wake: Option<Span>,
    /// By how much the host's clock was set, in ns.
    pub clock_step_ns: Option<i64>,
}

/// Watch over one card: the news in its counts.
#[derive(Clone, Copy, Default, Debug)]
pub struct CardWatch {
    carrier: Option<bool>,
}

impl CardWatch {
    /// News in a sample; that there is a link or none is news when it is seen first.
    pub fn events(&mut self, sample: &CardSample) -> impl Iterator<Item = HostEvent> + use<> {
        let before = self.carrier.replace(sample.carrier);
        let went_and_came = sample.carrier_changes > 1 && before == Some(sample.carrier);
        let is_news = went_and_came || before != Some(sample.carrier);
        let count = |count: u64, event: fn(u64) -> HostEvent| (count > 0).then(|| event(count));
        let CardSample { crc, damaged: other, .. } = *sample;
        [
            went_and_came.then_some(HostEvent::Carrier(!sample.carrier)),
            is_news.then_some(HostEvent::Carrier(sample.carrier)),
            count(sample.send_failures, HostEvent::SendFailures),
            (crc + other > 0).then_some(HostEvent::CardErrors { crc, other }),
            count(sample.card_drops, HostEvent::CardDrops),
            count(sample.socket_drops, HostEvent::SocketDrops),
            sample.latest_wake.map(HostEvent::Late),
            sample.clock_step_ns.map(HostEvent::ClockStep),
        ]
        .into_iter()
        .flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(watch: &mut CardWatch, sample: CardSample) -> Vec<HostEvent> {
        watch.events(&sample).collect()
    }

    #[test]
    fn carrier_is_told_once_and_again_when_it_went_and_came_between_two_looks() {
        let quiet = CardSample { carrier: true, ..CardSample::default() };
        let mut watch = CardWatch::default();
        assert_eq!(events(&mut watch, quiet), [HostEvent::Carrier(true)]);
        assert_eq!(events(&mut watch, quiet), []);
        let both = [HostEvent::Carrier(false), HostEvent::Carrier(true)];
        assert_eq!(events(&mut watch, CardSample { carrier_changes: 2, ..quiet }), both);
        assert_eq!(events(&mut watch, CardSample::default()), [HostEvent::Carrier(false)]);
    }

    #[test]
    fn all_that_is_counted_is_told() {
        let mut watch = CardWatch { carrier: Some(true) };
        let sample = CardSample {
            carrier: true,
            crc: 5,
            damaged: 2,
            card_drops: 3,
            socket_drops: 4,
            send_failures: 1,
            latest_wake: Some(Span::us(7)),
            clock_step_ns: Some(-5),
            ..CardSample::default()
        };
        let expected = [
            HostEvent::SendFailures(1),
            HostEvent::CardErrors { crc: 5, other: 2 },
            HostEvent::CardDrops(3),
            HostEvent::SocketDrops(4),
            HostEvent::Late(Span::us(7)),
            HostEvent::ClockStep(-5),
        ];
        assert_eq!(events(&mut watch, sample), expected);
    }
}
