//! Recording of bundles beside a diagnosis.

use std::path::PathBuf;

use linesman_diagnosis::report::Diagnosis;
use linesman_diagnosis::{Engine, Event, FrameSeen, HostObservation};
use linesman_link::unix_time::UnixTime;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::bundle::{BundleNews, BundleReceiver, BundleRecorder, BundleSettings};

use super::anonymise::anonymise_file;
use super::findings_in_words;
use crate::amount::{SECOND, count, duration};
use crate::command::diagnose::{NO_CLOCK, names};
use crate::failure::Failure;
use crate::output::{Output, Paint};
use crate::text;
use crate::text::finding::Writer;
use crate::version;

/// Bytes of a megabyte.
const MEGABYTE: u64 = 1_000_000;
/// Columns of a report.
const WIDTH: usize = 100;

/// What can be asked.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct BundleArguments {
    /// For each error or warning, write a bundle to this folder: one file with the frames before and after it, what the
    /// host noticed, what was planned and what was said; `linesman diagnose BUNDLE` judges it again
    #[arg(long, value_name = "DIR")]
    pub(crate) bundles: Option<PathBuf>,
    /// Frames of so long before a finding
    #[arg(long, value_name = "TIME", default_value = "10s", requires = "bundles",
          value_parser = duration(SECOND, Span::ms(100), Span::s(600)))]
    bundle_before: Span,
    /// And of so long after it; findings meanwhile are in the same bundle
    #[arg(long, value_name = "TIME", default_value = "5s", requires = "bundles",
          value_parser = duration(SECOND, Span::ms(10), Span::s(600)))]
    bundle_after: Span,
    /// Memory for frames, in megabytes: half for the time before the last finding, a quarter each for the start of the run
    /// and for earlier findings
    #[arg(long, value_name = "MEGABYTES", default_value = "64", requires = "bundles", value_parser = count(1, 400))]
    bundle_memory: u64,
    /// Keep so many bundles of this run: the oldest are removed, and that is said
    #[arg(long, value_name = "COUNT", default_value = "20", requires = "bundles", value_parser = count(1, 99_999))]
    bundle_keep: u64,
    /// Write them as `linesman bundle anonymise` does: without names, serial numbers, process data and addresses of network
    /// cards
    #[arg(long, requires = "bundles")]
    bundle_anonymise: bool,
    /// Keep so many megabytes of them
    #[arg(long, value_name = "MEGABYTES", default_value = "1000", requires = "bundles",
          value_parser = count(1, 1_000_000))]
    bundle_size: u64,
}

impl BundleArguments {
    /// Begins to record, where that was asked for. `start` is the date of the run's time 0; `cards` are the names of its
    /// cards.
    pub(crate) fn start(
        &self,
        start: UnixTime,
        cards: &[String],
    ) -> Result<Option<(BundleRecorder, BundleReceiver)>, Failure> {
        let Some(folder) = &self.bundles else { return Ok(None) };
        let settings = BundleSettings {
            folder: folder.clone(),
            before: self.bundle_before,
            after: self.bundle_after,
            memory: usize::try_from(self.bundle_memory * MEGABYTE).unwrap_or(usize::MAX),
            files: self.bundle_keep as usize,
            bytes: self.bundle_size * MEGABYTE,
            tool: version::tool(),
            start,
            cards: cards.to_vec(),
            report,
            rework: self.bundle_anonymise.then_some(anonymise_file),
        };
        BundleRecorder::start(settings).map(Some).map_err(|error| {
            let reason = format!("{}: a folder for bundles: {error}", folder.display());
            Failure::new(reason, "name a folder that you may write to")
        })
    }

    /// The same for a diagnosis that is made here.
    pub(crate) fn recording(
        &self,
        start: UnixTime,
        cards: &[String],
    ) -> Result<Option<BundleRecording>, Failure> {
        let started = self.start(start, cards)?;
        Ok(started.map(|(recorder, news)| BundleRecording { recorder, news }))
    }
}

/// The report of a diagnosis.
pub(super) fn report(diagnosis: &Diagnosis, engine: &Engine) -> String {
    let writer = Writer {
        names: &names(engine),
        paint: Paint::PLAIN,
        width: WIDTH,
        timed: diagnosis.clock != NO_CLOCK,
        place: &diagnosis.source,
    };
    text::diagnosis::write(diagnosis, &writer)
}

/// A recorder of bundles, and where it tells what became of them.
pub(crate) struct BundleRecording {
    recorder: BundleRecorder,
    news: BundleReceiver,
}

impl BundleRecording {
    /// A frame that the diagnosis is shown.
    pub(crate) fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.recorder.frame(frame);
    }

    /// An observation of the host that it is shown.
    pub(crate) fn host(&mut self, observation: &HostObservation) {
        self.recorder.host(observation);
    }

    /// Frames that it was not shown.
    pub(crate) fn missed(&mut self, frames: u64, at: Instant) {
        self.recorder.missed(frames, at);
    }

    /// Something happened to a finding.
    pub(crate) fn event(&mut self, event: &Event) {
        self.recorder.event(event);
    }

    /// Everything up to `now` was shown.
    pub(crate) fn turn(&mut self, now: Instant, engine: &Engine, told: bool, output: &mut Output) {
        self.recorder.turn(now, engine);
        tell(&self.news, told, output);
    }

    /// The diagnosis has ended.
    pub(crate) fn finish(&mut self, at: Instant, engine: &Engine, told: bool, output: &mut Output) {
        self.recorder.finish(at, engine);
        tell(&self.news, told, output);
    }
}

/// Tells what became of bundles: failures in any case, all else where people are `told`.
pub(crate) fn tell(news: &BundleReceiver, told: bool, output: &mut Output) {
    while let Ok(news) = news.try_recv() {
        match news {
            BundleNews::Written { path, findings, .. } if told => {
                let findings = findings_in_words(&findings);
                output.line(&format!("bundle {}: {findings}", path.display()));
            }
            BundleNews::Removed { path } if told => {
                output.line(&format!(
                    "bundle {} is removed: newer ones need its room",
                    path.display()
                ));
            }
            BundleNews::Written { .. } | BundleNews::Removed { .. } => {}
            BundleNews::Failed { reason } => {
                output.fail(&Failure::new(reason, "make room there; the diagnosis goes on"));
            }
        }
    }
}
