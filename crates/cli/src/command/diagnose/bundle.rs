//! A bundle: judged again, and held against what was said when it was written.

use linesman_diagnosis::Engine;
use linesman_link::input::Input;
use linesman_runtime::bundle::{Bundle, BundleFinding, differences, findings};

use super::{DiagnosisRun, Judged, names};
use crate::command::bundle::findings_in_words;
use crate::failure::Failure;
use crate::output::Output;
use crate::text::quantity::count;

/// Judges a bundle by what the diagnosis of the run was told. `--project` replaces what was planned then.
pub(super) fn judge(
    input: Input,
    session: &mut DiagnosisRun,
    output: &mut Output,
) -> Result<Judged, Failure> {
    let bundle = Bundle::of(input)?;
    let wanted = std::mem::take(&mut session.setup);
    let mut setup = bundle.setup();
    if wanted.project.is_some() {
        (setup.project, setup.exchange) = (wanted.project, wanted.exchange);
    }
    setup.exchanges = wanted.exchanges;
    session.setup = setup;
    let mut engine = Engine::new(session.setup.clone());
    if let Some(asking) = bundle.diagnosis.as_ref().and_then(|said| said.asking.clone()) {
        engine.note_asking(asking);
    }
    let (is_whole, at) = bundle.replay(&mut engine, |engine| session.follow(engine, output))?;
    session.flush(&names(&engine), output);
    if !is_whole {
        output
            .warn(&format!("{}: its frames end early: judged up to there", bundle.name.display()));
    }
    let diagnosis = engine.diagnosis();
    if diagnosis.network.frames.0 == 0 {
        let reason = format!("{}: no EtherCAT frame is in it", bundle.name.display());
        return Err(Failure::new(reason, "copy the bundle anew from where it was written"));
    }
    for left_out in &bundle.manifest.left_out {
        output.warn(&format!("{}: not in the bundle: {left_out}", bundle.name.display()));
    }
    let found = findings(&diagnosis);
    let (missing, new) = differences(&bundle.manifest.findings, &found);
    let is_same = missing.is_empty() && new.is_empty();
    for (which, what) in [(missing, "said when it was written and not found again"), (new, "new")] {
        if !which.is_empty() {
            let which: Vec<BundleFinding> = which.into_iter().cloned().collect();
            let which = findings_in_words(&which);
            output.warn(&format!("{}: {what}: {which}", bundle.name.display()));
        }
    }
    session.agreement = is_same.then(|| {
        let said = count(found.len() as u64, "finding");
        format!("As when the bundle was written: {said}, with the same codes, places and causes.")
    });
    let names = names(&engine);
    Ok(Judged { engine, names, at })
}
