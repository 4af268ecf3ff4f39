//! `linesman sii`: the EEPROM of a SubDevice, read, written, compared, and its alias.

mod report;

use std::path::{Path, PathBuf};

use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::register;
use linesman_proto::sii::word::{CHECKSUM, STATION_ALIAS};
use linesman_proto::sii::{Image, WordAddress, checksum};

use super::sdo::value::whole;
use super::service::{ServiceError, ServiceLine, ServiceTarget, end};
use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::Output;
use crate::text::quantity::count;
pub(crate) use report::Report;

/// The largest EEPROM that controllers address with two bytes.
const LARGEST: u64 = 512 << 10;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) place: ServiceTarget,
    #[command(subcommand)]
    action: Action,
    /// JSON, schema linesman.sii/1
    #[arg(long, global = true)]
    pub(crate) json: bool,
}

#[derive(clap::Subcommand, Debug)]
enum Action {
    /// Read it, and say what is in it
    Read {
        /// Save its bytes
        #[arg(long, value_name = "FILE")]
        save: Option<PathBuf>,
        /// All of it, not only what is used
        #[arg(long)]
        whole: bool,
    },
    /// Write an image, after a copy of what is there was saved; then read it back
    Write {
        /// The image
        file: PathBuf,
        /// Where the copy goes; sii-STATION-backup.bin here unless said
        #[arg(long, value_name = "FILE")]
        backup: Option<PathBuf>,
        /// Also an image of another device, or one that is damaged
        #[arg(long)]
        force: bool,
    },
    /// Compare it with an image; exit status 1 when they differ
    Verify {
        /// The image
        file: PathBuf,
    },
    /// Tell its station alias, or set it
    Alias {
        /// The new alias, 0 to 65535; 0 for none
        #[arg(value_parser = alias)]
        alias: Option<u16>,
        /// Where the copy of what is there goes; sii-STATION-backup.bin here unless said
        #[arg(long, value_name = "FILE")]
        backup: Option<PathBuf>,
    },
}

fn alias(text: &str) -> Result<u16, String> {
    let number = whole(text).and_then(|number| u16::try_from(number).ok());
    number.ok_or_else(|| format!("`{text}`: expected a number, 0 to 65535"))
}

/// Does what was asked.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    // What is wrong with files is told before anything is sent.
    let image = match &arguments.action {
        Action::Write { file, .. } | Action::Verify { file } => Some(image(file)?),
        Action::Read { save: Some(path), .. } => {
            files::refuse_to_overwrite(path)?;
            None
        }
        Action::Read { .. } | Action::Alias { .. } => None,
    };
    let mut session = ServiceLine::open(&arguments.place.line)?;
    let id = session.device(&arguments.place.device)?;
    let mut differs = false;
    let outcome = match &arguments.action {
        Action::Read { save, whole } => read(&mut session, id, save.as_deref(), *whole),
        Action::Write { file, backup, force } => {
            let image = image.unwrap_or_default();
            write(&mut session, id, file, &image, backup.as_deref(), *force, output)
        }
        Action::Verify { file } => {
            let image = image.unwrap_or_default();
            let verified = verify(&mut session, id, file, &image);
            differs = verified.as_ref().is_ok_and(|report| report.differs());
            verified
        }
        Action::Alias { alias: None, .. } => tell_alias(&mut session, id),
        Action::Alias { alias: Some(alias), backup } => {
            set_alias(&mut session, id, *alias, backup.as_deref(), output)
        }
    };
    let outcome = outcome.map(|report| {
        if arguments.json {
            output.json(&report);
        } else {
            output.text(&report.text(&session.label(id), output));
        }
    });
    let status = end(outcome, arguments.json, output)?;
    Ok(if status == Status::Good && differs { Status::Findings } else { status })
}

/// An image of a file: whole words, at least the fixed ones.
fn image(path: &Path) -> Result<Vec<u8>, Failure> {
    let bytes = files::bytes(path, "an image of an EEPROM", LARGEST)?;
    if bytes.len() < 128 || bytes.len() % 2 != 0 {
        let reason = format!(
            "{}: {} bytes, expected an image of whole words, at least 128 bytes",
            path.display(),
            bytes.len()
        );
        return Err(Failure::new(
            reason,
            "name a file that `linesman sii WHERE DEVICE read --save FILE` wrote",
        ));
    }
    Ok(bytes)
}

fn read(
    session: &mut ServiceLine,
    id: DeviceId,
    save: Option<&Path>,
    whole: bool,
) -> Result<Report, ServiceError> {
    let bytes = session.bytes(id, Service::ReadSii { whole })?;
    if let Some(path) = save {
        files::write_new_bytes(path, "the image", &bytes)?;
    }
    Ok(Report::read(session.report(id), &bytes, save))
}

/// What is there is saved before anything is written: as much as will be written, or all that is used.
fn back_up(
    session: &mut ServiceLine,
    id: DeviceId,
    wanted: usize,
    path: Option<&Path>,
) -> Result<(Vec<u8>, PathBuf), ServiceError> {
    let station = session.report(id).station;
    let path = path.map_or_else(|| format!("sii-0x{station:04X}-backup.bin").into(), PathBuf::from);
    files::refuse_to_overwrite(&path)?;
    let mut there = session.bytes(id, Service::ReadSii { whole: false })?;
    if there.len() < wanted {
        there = session.bytes(id, Service::ReadSii { whole: true })?;
    }
    files::write_new_bytes(&path, "the copy of what is there", &there)?;
    Ok((there, path))
}

fn write(
    session: &mut ServiceLine,
    id: DeviceId,
    file: &Path,
    image: &[u8],
    backup: Option<&Path>,
    force: bool,
    output: &Output,
) -> Result<Report, ServiceError> {
    if !force {
        fits(session, id, file, image)?;
    }
    let (there, backup) = back_up(session, id, image.len(), backup)?;
    let room = report::size_of(&there);
    if image.len() > room {
        let reason = format!(
            "{}: {} bytes, but the EEPROM of {} holds {room}",
            file.display(),
            image.len(),
            session.label(id)
        );
        return Err(Failure::new(reason, "check that it is the image of this SubDevice").into());
    }
    let words = put(session, id, WordAddress(0), image)?;
    warn_of_power(session, id, words, output);
    Ok(Report::wrote(session.report(id), "write", image, words, &backup))
}

/// Writes words, which are read back one by one.
fn put(
    session: &mut ServiceLine,
    id: DeviceId,
    at: WordAddress,
    data: &[u8],
) -> Result<u32, ServiceError> {
    match session.ask(id, Service::WriteSii { at, data: data.to_vec() })? {
        ServiceAnswer::Written { words } => Ok(words),
        ServiceAnswer::Done | ServiceAnswer::Data(_) | ServiceAnswer::State { .. } => Ok(0),
    }
}

fn warn_of_power(session: &ServiceLine, id: DeviceId, words: u32, output: &Output) {
    if session.is_passing() {
        output.warn("this virtual segment ends with the command, and what was written too");
    } else if words > 0 {
        output.warn(&format!(
            "{} works as before until it is switched off and on",
            session.label(id)
        ));
    }
}

/// An image of another device, or a damaged one, is not written by mistake.
fn fits(session: &ServiceLine, id: DeviceId, file: &Path, image: &[u8]) -> Result<(), Failure> {
    let advice = "check that it is the image of this SubDevice; --force writes it all the same";
    let wrong = |what: String| Failure::new(format!("{}: {what}", file.display()), advice);
    let parsed = Image::parse(image).map_err(|error| wrong(error.to_string()))?;
    if let linesman_proto::sii::Checksum::Wrong(_) = parsed.checksum {
        return Err(wrong("the checksum of its first words is wrong".to_owned()));
    }
    let found = session.known(id).and_then(|known| known.identity);
    let Some(found) = found else { return Ok(()) };
    let (theirs, ours) = (
        (parsed.identity.vendor_id, parsed.identity.product_code),
        (found.vendor_id, found.product_code),
    );
    if theirs != ours {
        return Err(wrong(format!(
            "it is of vendor 0x{:08X}, product 0x{:08X}, and {} is of vendor 0x{:08X}, product \
             0x{:08X}",
            theirs.0,
            theirs.1,
            session.label(id),
            ours.0,
            ours.1
        )));
    }
    Ok(())
}

fn verify(
    session: &mut ServiceLine,
    id: DeviceId,
    file: &Path,
    image: &[u8],
) -> Result<Report, ServiceError> {
    let mut there = session.bytes(id, Service::ReadSii { whole: false })?;
    if there.len() < image.len() {
        there = session.bytes(id, Service::ReadSii { whole: true })?;
    }
    Ok(Report::verified(session.report(id), &there, image, file))
}

fn tell_alias(session: &mut ServiceLine, id: DeviceId) -> Result<Report, ServiceError> {
    let bytes = session.bytes(id, Service::ReadSii { whole: false })?;
    let at = Service::ReadRegister { address: register::STATION_ALIAS.address, len: 2 };
    let in_use = session.bytes(id, at)?.first_chunk().map(|word| u16::from_le_bytes(*word));
    Ok(Report::alias(session.report(id), &bytes, in_use))
}

/// The alias is guarded by the checksum of the first words: both are written.
pub(crate) fn set_alias(
    session: &mut ServiceLine,
    id: DeviceId,
    alias: u16,
    backup: Option<&Path>,
    output: &Output,
) -> Result<Report, ServiceError> {
    let mut others = session.devices().iter().filter(|other| other.id != id && alias != 0);
    if let Some(other) = others.find(|other| other.alias == alias) {
        let reason = format!("alias {alias} is that of {} already", other.label());
        return Err(Failure::new(reason, "choose another; `linesman scan` tells them").into());
    }
    let (there, backup) = back_up(session, id, 0, backup)?;
    let Some(guarded) = there.first_chunk::<14>() else {
        let reason = format!("the EEPROM of {} ends within its first words", session.label(id));
        return Err(Failure::new(
            reason,
            "write a whole image first: `linesman sii WHERE DEVICE write FILE`",
        )
        .into());
    };
    let mut guarded = *guarded;
    guarded[STATION_ALIAS.byte()..STATION_ALIAS.byte() + 2].copy_from_slice(&alias.to_le_bytes());
    let sum = u16::from(checksum(&guarded));
    // The checksum last: without it the controller would not load what is half written.
    let mut words = put(session, id, STATION_ALIAS, &alias.to_le_bytes())?;
    words += put(session, id, CHECKSUM, &sum.to_le_bytes())?;
    warn_of_power(session, id, words, output);
    let mut image = there;
    image[..14].copy_from_slice(&guarded);
    image[CHECKSUM.byte()..CHECKSUM.byte() + 2].copy_from_slice(&sum.to_le_bytes());
    Ok(Report::wrote(session.report(id), "alias", &image, words, &backup))
}

/// `2,048 bytes`.
fn bytes_text(len: usize) -> String {
    count(len as u64, "byte")
}
