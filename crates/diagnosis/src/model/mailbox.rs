//! Mailbox traffic of one controller, as far as it tells of trouble.

use std::collections::VecDeque;

use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::mailbox::coe::diagnosis::Severity;
use linesman_proto::mailbox::error_reply::ErrorReplyCode;
use linesman_proto::time::{Instant, Span};

use super::ethernet::EthernetHistory;
use super::{Seen, push_kept};

/// From so long on an answer is worth a word. SubDevices answer within some ms.
pub const NOTABLE: Span = Span::ms(100);
/// From so long on an answer is slow; MainDevices wait some seconds.
pub const SLOW: Span = Span::ms(300);

/// A mailbox over time.
#[derive(Clone, Default, Debug)]
pub struct MailboxHistory {
    /// The request that was taken and is not answered yet, by its object, where it names one.
    pub waiting: Option<Seen<Option<ObjectAddress>>>,
    /// Whether the latest request that was taken reads all entries of an object at once (complete access).
    pub reads_whole: bool,
    /// When somebody last looked for an answer.
    pub polled: Option<Instant>,
    /// The last look that found no message since the request that waits was taken.
    pub seen_empty: Option<Instant>,
    /// The first look that found a message, which nobody has fetched yet, since that request was taken.
    pub seen_full: Option<Instant>,
    /// Since when, and until when, requests are not taken; `None` when the latest one was.
    pub full: Option<(Seen<()>, Instant)>,
    /// Since when, and until when, the mailbox for requests was read full (SyncManager 0, 0x0805): nobody fetches what is
    /// in it. `None` when it was last read empty, or took a request since.
    pub unfetched: Option<(Seen<()>, Instant)>,
    /// Stretches of time without an answer, or without a request being taken, that are over: from, to.
    pub stuck: VecDeque<(Instant, Instant)>,
    /// Requests that were refused, oldest first.
    pub refusals: VecDeque<Seen<MailboxRefusal>>,
    /// Answers that took [`NOTABLE`] or longer, oldest first.
    pub slow: VecDeque<Seen<SlowAnswer>>,
    /// Fragments of Ethernet frames (EoE) that were taken since the latest answer: an error reply may be about one of
    /// them, as nothing else answers a fragment.
    pub fragments: u32,
    /// Error replies that came while a request waits that was taken behind fragments: about them, if the request is
    /// answered after all.
    pub doubtful: VecDeque<Seen<ErrorReplyCode>>,
    /// Ethernet frames through it (EoE).
    pub ethernet: EthernetHistory,
    /// Messages of the diagnosis history (object 0x10F3) in the order in which they were read.
    pub messages: VecDeque<Seen<HistoryMessage>>,
}

/// A request that a SubDevice refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum MailboxRefusal {
    /// An SDO was aborted.
    Abort {
        /// Of this object.
        object: ObjectAddress,
        /// With this code.
        code: u32,
        /// Whether all its entries were to be read at once, as far as the request was seen.
        reads_whole: bool,
    },
    /// The mailbox itself answered with an error.
    Error(ErrorReplyCode),
}

/// An answer that came late.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SlowAnswer {
    /// What was asked for, where the request names an object.
    pub object: Option<ObjectAddress>,
    /// When it was asked.
    pub asked: Instant,
    /// Time that the SubDevice took at least: until its answer was seen in the mailbox, or the mailbox was last seen without it. An
    /// answer that lies there until somebody has the time to fetch it is not late.
    pub took: Span,
    /// Not an answer came late: a fragment of an Ethernet frame was taken late, which nothing answers.
    pub carries_frame: bool,
}

/// A message of a diagnosis history.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct HistoryMessage {
    /// The code.
    pub code: u32,
    /// How serious the SubDevice takes it.
    pub severity: Severity,
    /// Number of the text in its description.
    pub text: u16,
    /// When it happened by the SubDevice's clock, in ns; 0 when it has none.
    pub time_ns: u64,
    /// The parameters as they were sent.
    pub parameters: Vec<u8>,
}

impl MailboxHistory {
    /// A request was taken; one that reads all entries of an object at once, or another one.
    pub fn asked(
        &mut self,
        object: Option<ObjectAddress>,
        reads_whole: bool,
        at: Instant,
        frame: u64,
    ) {
        self.reads_whole = reads_whole;
        self.settle_errors(false);
        if let Some((since, until)) = self.full.take() {
            self.note_stuck(since.at, until.max(at));
        }
        self.fetched();
        (self.seen_empty, self.seen_full) = (None, None);
        if let Some(waiting) = self.waiting.replace(Seen::new(object, at, Some(frame))) {
            self.note_stuck(waiting.at, at);
        }
    }

    /// A fragment of an Ethernet frame was taken, which nothing answers. Says whether the mailbox had been full for long
    /// enough to be worth a word.
    pub fn frame_taken(&mut self, at: Instant, frame: u64) -> bool {
        self.fragments = self.fragments.saturating_add(1);
        self.fetched();
        let Some((since, until)) = self.full.take() else { return false };
        self.note_stuck(since.at, until);
        let took = until.since(since.at);
        if took < NOTABLE || took >= STUCK {
            return took >= STUCK;
        }
        let slow = SlowAnswer { object: None, asked: since.at, took, carries_frame: true };
        push_kept(&mut self.slow, Seen::new(slow, at, Some(frame)));
        true
    }

    /// A request was not taken: the one before is still in the mailbox.
    pub fn not_taken(&mut self, at: Instant, frame: u64) {
        match &mut self.full {
            Some((_, until)) => *until = at,
            None => self.full = Some((Seen::new((), at, Some(frame)), at)),
        }
    }

    /// The mailbox for requests was read, full or not. Says whether time alone may show that it is stuck.
    pub fn read_status(&mut self, is_full: bool, at: Instant, frame: u64) -> bool {
        if !is_full {
            self.fetched();
            return false;
        }
        let since = self.unfetched.map_or(Seen::new((), at, Some(frame)), |(since, _)| since);
        self.unfetched = Some((since, at));
        at.since(since.at) >= STUCK
    }

    /// Somebody looked whether a message lies in the mailbox of answers, or process data tell of it.
    pub fn looked(&mut self, is_full: bool, at: Instant) {
        if is_full {
            self.seen_full.get_or_insert(at);
        } else {
            (self.seen_empty, self.seen_full) = (Some(at), None);
        }
    }

    /// A message was fetched. Says whether a request still waits: then it was about something else.
    pub fn fetched_other(&mut self, at: Instant) -> bool {
        let is_other = self.waiting.is_some();
        if is_other {
            self.looked(false, at);
        }
        is_other
    }

    fn fetched(&mut self) {
        if let Some((since, until)) = self.unfetched.take() {
            self.note_stuck(since.at, until);
        }
    }

    /// The mailbox answered with an error, which does not name the message that it is about: a fragment that was taken
    /// before, or the request that waits. Requests are answered in order.
    pub fn error_reply(&mut self, code: ErrorReplyCode, at: Instant, frame: u64) {
        let is_about_fragment = self.fragments > 0;
        self.fragments = self.fragments.saturating_sub(1);
        match (is_about_fragment, &self.waiting) {
            (true, Some(_)) => push_kept(&mut self.doubtful, Seen::new(code, at, Some(frame))),
            (true, None) => self.ethernet.refuse(code, at, frame),
            (false, _) => {
                self.answered(at, frame);
                self.refused(MailboxRefusal::Error(code), at, frame);
            }
        }
    }

    /// It is known what the doubtful error replies were about: the last one was the answer to the request, if that did
    /// not get another one.
    fn settle_errors(&mut self, is_answered: bool) {
        let mut doubtful = std::mem::take(&mut self.doubtful);
        if !is_answered && let Some(last) = doubtful.pop_back() {
            let refusal = MailboxRefusal::Error(last.value);
            self.answered_by(last.at, last.frame.unwrap_or(0));
            self.refused(refusal, last.at, last.frame.unwrap_or(0));
        }
        for seen in doubtful {
            self.ethernet.refuse(seen.value, seen.at, seen.frame.unwrap_or(0));
        }
    }

    /// An answer came. Says whether it tells of trouble: it took long, or fragments before it were refused.
    pub fn answered(&mut self, at: Instant, frame: u64) -> bool {
        let were_doubtful = !self.doubtful.is_empty();
        self.settle_errors(true);
        self.fragments = 0;
        self.answered_by(at, frame) || were_doubtful
    }

    /// The request that waits is answered. Says whether it took long enough to be worth a word.
    fn answered_by(&mut self, at: Instant, frame: u64) -> bool {
        let Some(waiting) = self.waiting.take() else { return false };
        let (empty, full) = (self.seen_empty.take(), self.seen_full.take());
        // Where nobody looked before it was fetched, and no bit tells of it, it may have come just then.
        let took = full.or(empty).unwrap_or(at).since(waiting.at);
        if took < NOTABLE {
            return false;
        }
        let (object, asked) = (waiting.value, waiting.at);
        let slow = SlowAnswer { object, asked, took, carries_frame: false };
        push_kept(&mut self.slow, Seen::new(slow, at, Some(frame)));
        true
    }

    /// Whether time alone may show that it is stuck.
    #[must_use]
    pub const fn is_open(&self) -> bool {
        self.waiting.is_some() || self.full.is_some() || self.unfetched.is_some()
    }

    /// A request was refused.
    pub fn refused(&mut self, refusal: MailboxRefusal, at: Instant, frame: u64) {
        push_kept(&mut self.refusals, Seen::new(refusal, at, Some(frame)));
    }

    /// A message of the diagnosis history was read. Says whether it is new.
    pub fn note(&mut self, message: HistoryMessage, at: Instant, frame: u64) -> bool {
        if self.messages.iter().any(|known| known.value == message) {
            return false;
        }
        push_kept(&mut self.messages, Seen::new(message, at, Some(frame)));
        true
    }

    fn note_stuck(&mut self, from: Instant, to: Instant) {
        if to.since(from) >= STUCK {
            push_kept(&mut self.stuck, (from, to));
        }
    }
}

/// A request that is not taken, or not answered, for so long: the mailbox is stuck.
pub const STUCK: Span = Span::ms(900);

#[cfg(test)]
mod tests {
    use super::*;

    const MEMORY: ErrorReplyCode = ErrorReplyCode::NoMemory;
    const SERVICE: ErrorReplyCode = ErrorReplyCode::ServiceNotSupported;

    fn at(ms: u64) -> Instant {
        Instant::ZERO + Span::ms(ms)
    }

    /// Codes of refused fragments, and of refused requests.
    fn refused(mailbox: &MailboxHistory) -> (Vec<ErrorReplyCode>, Vec<MailboxRefusal>) {
        let fragments = mailbox.ethernet.refused.iter().map(|seen| seen.value);
        (fragments.collect(), mailbox.refusals.iter().map(|seen| seen.value).collect())
    }

    #[test]
    fn error_reply_between_a_request_and_its_answer_is_about_the_fragment_before_it() {
        let mut mailbox = MailboxHistory::default();
        mailbox.frame_taken(at(0), 1);
        mailbox.asked(None, false, at(1), 2);
        mailbox.error_reply(MEMORY, at(2), 3);
        assert_eq!(refused(&mailbox), (vec![], vec![]), "it may be about either");
        assert!(mailbox.answered(at(3), 4), "now it is known");
        assert_eq!(refused(&mailbox), (vec![MEMORY], vec![]));
        assert!(!mailbox.is_open());
        // An error reply with no fragment before it answers the request.
        mailbox.asked(None, false, at(4), 5);
        mailbox.error_reply(SERVICE, at(5), 6);
        assert_eq!(refused(&mailbox).1, [MailboxRefusal::Error(SERVICE)]);
        assert!(!mailbox.is_open());
    }

    #[test]
    fn answer_that_lies_in_the_mailbox_until_somebody_fetches_it_is_not_late() {
        let took = |looks: &[(bool, u64)]| {
            let mut mailbox = MailboxHistory::default();
            mailbox.asked(None, false, at(0), 1);
            looks.iter().for_each(|(is_full, ms)| mailbox.looked(*is_full, at(*ms)));
            mailbox.answered(at(400), 2);
            mailbox.slow.back().map(|seen| seen.value.took.as_nanos() / 1_000_000)
        };
        assert_eq!(took(&[]), Some(400), "nobody has looked before");
        assert_eq!(took(&[(false, 20), (true, 30), (true, 390)]), None);
        assert_eq!(took(&[(false, 20)]), None, "it may have come at 21 ms");
        assert_eq!(took(&[(false, 20), (false, 390)]), Some(390));
        assert_eq!(took(&[(false, 90), (true, 120)]), Some(120));
    }

    #[test]
    fn last_error_reply_is_the_answer_where_no_other_one_comes() {
        let mut mailbox = MailboxHistory::default();
        mailbox.frame_taken(at(0), 1);
        mailbox.frame_taken(at(1), 2);
        mailbox.asked(None, false, at(2), 3);
        mailbox.error_reply(MEMORY, at(3), 4);
        mailbox.error_reply(SERVICE, at(4), 5);
        mailbox.asked(None, false, at(2_000), 6);
        assert_eq!(refused(&mailbox), (vec![MEMORY], vec![MailboxRefusal::Error(SERVICE)]));
        assert!(mailbox.stuck.is_empty(), "it was answered by an error, not kept waiting");
    }
}
