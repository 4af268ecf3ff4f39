//! Pages about datagram commands and about ports.

use linesman_proto::command::{Addressing, Command};
use linesman_proto::port::Port;

use super::page::{Kind, Page};

/// A page about a datagram command.
pub(super) fn command(command: Command) -> Page {
    let effect = command.effect();
    let who = match command.addressing() {
        Addressing::None => "nobody",
        Addressing::Position => {
            "the controller at a position (auto-increment address: ADP counts up to 0)"
        }
        Addressing::Station => "the controller with a station address (configured address)",
        Addressing::Broadcast => "all controllers",
        Addressing::Logical => "all controllers whose FMMUs map the logical address",
    };
    let counter = match (command.increment(true, false), command.increment(false, true)) {
        (0, 0) => "nothing".to_owned(),
        (read, write)
            if command.increment(true, true) == read + write && effect.reads && effect.writes =>
        {
            format!("{read} for the read, {write} for the write, {} for both", read + write)
        }
        (read, write) => format!("{} for each controller that obeys", read.max(write)),
    };
    Page::new(Kind::Command, format!("Command {} (code {})", command.name(), command.code()))
        .text(command.meaning())
        .fact("whom", who)
        .fact("counter", format!("each adds to the working counter: {counter}"))
        .fact("use", use_of(command))
        .fact("in Wireshark", format!("`ecat.cmd == 0x{:02x}`", command.code()))
        .fact("see", "ETG.1000.4, commands; S1 chapter 2")
}

const fn use_of(command: Command) -> &'static str {
    match command {
        Command::Nop => {
            "Fills a place in a frame, such as a command that is not sent in this cycle."
        }
        Command::Aprd | Command::Apwr => {
            "Scan and start-up, before SubDevices have addresses; positions shift when a port opens or closes."
        }
        Command::Fprd | Command::Fpwr => {
            "Registers and mailboxes of one SubDevice. Working counter 0: it is gone, has lost its address, \
             or its SyncManager refused."
        }
        Command::Aprw | Command::Fprw | Command::Brw => {
            "Rare; not every controller has it (bit 10 of 0x0008)."
        }
        Command::Brd => {
            "Presence: its working counter is the number of SubDevices that answer, and AL status of all is \
             ORed into the data."
        }
        Command::Bwr => {
            "Clears and sets the same register in all SubDevices, such as 0x0120 or 0x0300."
        }
        Command::Lrd => "Inputs of process data, and the bits that say which mailboxes are full.",
        Command::Lwr => "Outputs of process data.",
        Command::Lrw => {
            "Inputs and outputs in one datagram. A counter that is 1 short misses inputs, 2 outputs, 3 both. \
             Not every controller has it (bit 9 of 0x0008)."
        }
        Command::Armw | Command::Frmw => {
            "Hands the time of the reference clock (0x0910) to all SubDevices behind it, in each cycle."
        }
    }
}

/// A page about a port.
pub(super) fn port(port: Port) -> Page {
    let index = port.index();
    let text = match port {
        Port::A => {
            "The IN port: it faces the MainDevice when wired as intended. The processing unit sits behind \
             it; it stays open when all others are closed."
        }
        Port::B => {
            "The first OUT port: of a terminal the contact to the next one, of EK1100 the E-bus."
        }
        Port::C => "A further OUT port: the second socket of a coupler (EK1100: X2 OUT).",
        Port::D => "A further OUT port, of junctions; frames take it before B and C.",
    };
    let address = |first: usize, step: usize| format!("0x{:04X}", first + step * index);
    Page::new(Kind::Port, format!("Port {port} (port {index} in data sheets)"))
        .text(text)
        .fact("order", "Inside a controller frames pass the ports as A, D, B, C (0, 3, 1, 2).")
        .list(
            "registers",
            [
                format!(
                    "0x0110 bit {}: link; bit {}: closed; bit {}: communication",
                    4 + index,
                    8 + 2 * index,
                    9 + 2 * index
                ),
                format!(
                    "{}: damaged frames (low byte) and bad symbols (high byte)",
                    address(0x0300, 2)
                ),
                format!("{}: errors forwarded, counted before", address(0x0308, 1)),
                format!("{}: lost links", address(0x0310, 1)),
            ],
        )
        .fact("see", "S1 chapter 3")
}

/// The port that people call by letter or number: `port A`, `Port 3`.
pub(super) fn named_port(text: &str) -> Option<Port> {
    let lower = text.to_ascii_lowercase();
    let name = lower.strip_prefix("port")?.trim_matches([' ', '-', '_', ':']);
    let mut letters = name.chars();
    match (letters.next(), letters.next()) {
        (Some(digit @ '0'..='3'), None) => Port::from_index(digit as usize - '0' as usize),
        (Some(letter), None) => Port::from_letter(letter.to_ascii_uppercase()),
        (_, _) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_known_by_letter_and_number() {
        assert_eq!(named_port("Port 3"), Some(Port::D));
        assert_eq!(named_port("port b"), Some(Port::B));
        assert_eq!(named_port("portC"), Some(Port::C));
        for text in ["port", "port E", "port 4", "A", "ports"] {
            assert_eq!(named_port(text), None, "{text}");
        }
    }
}
