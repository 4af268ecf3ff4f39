//! Entry of the register table: address, rights, fields, meaning.
//!
//! Reference: S2 1.3 and chapter 2, whose columns these are. The constructors are `const`, so that
//! the table is data of the program and costs nothing at start.

use crate::address::RegisterAddress;
use crate::port::Port;

/// A register, or a family of equal registers side by side (one per port, FMMU or SyncManager).
#[derive(Clone, Copy, Debug)]
pub struct Register {
    /// The name of the data sheet, such as `AL status`.
    pub name: &'static str,
    /// Where it is; for a family, where the first one is.
    pub address: RegisterAddress,
    /// Length of one of them in bytes.
    pub len: u16,
    /// For a family: how many there are and how far apart.
    pub repeat: Option<Repeat>,
    /// What the EtherCAT side, that is a MainDevice, may do.
    pub ecat: Access,
    /// What the PDI side, that is the SubDevice's own processor, may do.
    pub pdi: Access,
    /// The value after a reset, where it does not depend on controller or configuration.
    pub reset: Option<u64>,
    /// What its bits are; bits without a field are reserved.
    pub fields: &'static [Field],
    /// What it is for, in a few sentences for an engineer.
    pub meaning: &'static str,
    /// Chapter of the data sheet, such as `S2 2.4.3`.
    pub reference: &'static str,
    /// Chapter title of the data sheet, such as `Data link layer`.
    pub group: &'static str,
    /// For a register that not every controller has: which have it.
    pub only: Option<&'static str>,
    /// What reading it from the EtherCAT side changes; most registers can be read without effect.
    pub read_effect: Option<&'static str>,
    /// How a whole register is written in few words where its fields alone would be unclear.
    pub(super) view: Option<View>,
}

impl Register {
    /// The registers of a family; 1 for a single register.
    #[must_use]
    pub const fn count(&self) -> u16 {
        match self.repeat {
            Some(repeat) => repeat.count,
            None => 1,
        }
    }

    /// Where the register `index` of a family is, counted from 0; `None` when there are fewer.
    #[must_use]
    pub const fn at(&self, index: u16) -> Option<RegisterAddress> {
        match self.repeat {
            Some(repeat) if index < repeat.count => {
                Some(RegisterAddress(self.address.0 + index * repeat.stride))
            }
            None if index == 0 => Some(self.address),
            Some(_) | None => None,
        }
    }

    /// Where the register of `port` is. For a register that is not kept per port: its one address.
    #[must_use]
    pub const fn of_port(&self, port: Port) -> RegisterAddress {
        match self.repeat {
            Some(repeat) if matches!(repeat.unit, Unit::Port) => {
                RegisterAddress(self.address.0 + port.index() as u16 * repeat.stride)
            }
            Some(_) | None => self.address,
        }
    }

    /// The first address behind it, behind the whole family if it is one.
    #[must_use]
    pub const fn end(&self) -> RegisterAddress {
        match self.repeat {
            Some(repeat) => {
                RegisterAddress(self.address.0 + (repeat.count - 1) * repeat.stride + self.len)
            }
            None => RegisterAddress(self.address.0 + self.len),
        }
    }

    /// What the EtherCAT side may do with the byte at `offset` from the start of a register.
    #[must_use]
    pub fn ecat_access(&self, offset: u16) -> Access {
        let own =
            || self.fields.iter().filter(|field| field.touches_byte(offset)).filter_map(|f| f.ecat);
        // A byte can be written when one of its fields can.
        own().find(|access| access.writes()).or_else(|| own().next()).unwrap_or(self.ecat)
    }

    /// The field with this name, in either case.
    #[must_use]
    pub fn field(&self, name: &str) -> Option<&'static Field> {
        self.fields.iter().find(|field| field.name.eq_ignore_ascii_case(name))
    }
}

/// Writes a register in few words, from data that begin at an offset behind its start; `None` when
/// the bytes it needs are not among them.
pub(super) type View = fn(offset: u16, data: &[u8]) -> Option<String>;

/// How the registers of a family lie.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Repeat {
    /// How many the address space has room for; a controller may have fewer.
    pub count: u16,
    /// Bytes from one to the next.
    pub stride: u16,
    /// What there is one of them for.
    pub unit: Unit,
}

/// What a register family has one member for.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Unit {
    /// A port, A to D.
    Port,
    /// An FMMU, counted from 0.
    Fmmu,
    /// A SyncManager, counted from 0.
    SyncManager,
}

/// What one side may do with a register.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Access {
    /// Nothing.
    None,
    /// Read; a write has no effect and adds nothing to the working counter.
    Read,
    /// Read and write.
    ReadWrite,
    /// Read, and write while the condition holds that the meaning names (`r/(w)`).
    ReadWriteIf,
    /// Read; any write clears, whatever the value (`r/w(clr)`).
    ReadClear,
}

impl Access {
    /// Whether this side may read.
    #[must_use]
    pub const fn reads(self) -> bool {
        match self {
            Self::None => false,
            Self::Read | Self::ReadWrite | Self::ReadWriteIf | Self::ReadClear => true,
        }
    }

    /// Whether a write of this side can have an effect.
    #[must_use]
    pub const fn writes(self) -> bool {
        match self {
            Self::None | Self::Read => false,
            Self::ReadWrite | Self::ReadWriteIf | Self::ReadClear => true,
        }
    }

    /// The column entry of the data sheet.
    #[must_use]
    pub const fn notation(self) -> &'static str {
        match self {
            Self::None => "-",
            Self::Read => "r",
            Self::ReadWrite => "r/w",
            Self::ReadWriteIf => "r/(w)",
            Self::ReadClear => "r/w(clr)",
        }
    }
}

/// Some bits of a register and what they mean.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Highest bit, counted from bit 0 of the first byte.
    pub high: u16,
    /// Lowest bit.
    pub low: u16,
    /// A short name, such as `loop closed, port B`.
    pub name: &'static str,
    /// What it says.
    pub meaning: &'static str,
    /// Values with a meaning of their own.
    pub values: &'static [(u32, &'static str)],
    /// How a value is written.
    pub form: Form,
    /// Unit of a number, such as `ns`; empty for a bare number.
    pub unit: &'static str,
    /// The EtherCAT side's right, where it differs from that of the whole register.
    pub ecat: Option<Access>,
}

impl Field {
    /// How many bits it has.
    #[must_use]
    pub const fn width(&self) -> u16 {
        self.high - self.low + 1
    }

    /// Whether it has a bit in the byte at `offset` from the start of the register.
    #[must_use]
    pub const fn touches_byte(&self, offset: u16) -> bool {
        self.low / 8 <= offset && offset <= self.high / 8
    }

    /// What the table calls this value, if it has a name.
    #[must_use]
    pub fn value_name(&self, value: u64) -> Option<&'static str> {
        self.values.iter().find(|(named, _)| u64::from(*named) == value).map(|(_, name)| *name)
    }
}

/// How the value of a field is written.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Form {
    /// One bit: yes or no.
    Flag,
    /// A value out of a list.
    Choice,
    /// A number.
    Decimal,
    /// A number best read in hexadecimal: addresses, patterns, identities.
    Hex,
    /// A number in two's complement.
    Signed,
    /// A number whose highest bit is its sign; the data sheet uses it for 0x092C.
    SignMagnitude,
    /// A run of bytes.
    Bytes,
}

/// A register, to be completed by the methods below.
pub(super) const fn register(
    name: &'static str,
    address: u16,
    len: u16,
    ecat: Access,
    pdi: Access,
    reference: &'static str,
) -> Register {
    Register {
        name,
        address: RegisterAddress(address),
        len,
        repeat: None,
        ecat,
        pdi,
        reset: None,
        fields: &[],
        meaning: "",
        reference,
        group: "",
        only: None,
        read_effect: None,
        view: None,
    }
}

impl Register {
    /// Makes it a family of four, one per port, right behind each other.
    pub(super) const fn per_port(self) -> Self {
        self.per(Unit::Port, 4)
    }

    /// Makes it a family of `count`, right behind each other.
    pub(super) const fn per(mut self, unit: Unit, count: u16) -> Self {
        self.repeat = Some(Repeat { count, stride: self.len, unit });
        self
    }

    /// Gives it its value after reset.
    pub(super) const fn reset(mut self, value: u64) -> Self {
        self.reset = Some(value);
        self
    }

    /// Gives it its fields, lowest first.
    pub(super) const fn fields(mut self, fields: &'static [Field]) -> Self {
        self.fields = fields;
        self
    }

    /// Says which controllers have it.
    pub(super) const fn only(mut self, which: &'static str) -> Self {
        self.only = Some(which);
        self
    }

    /// Says what reading it changes.
    pub(super) const fn read_effect(mut self, effect: &'static str) -> Self {
        self.read_effect = Some(effect);
        self
    }

    /// Says how the whole register is written in few words.
    pub(super) const fn view(mut self, view: View) -> Self {
        self.view = Some(view);
        self
    }

    /// Gives it its chapter and its meaning; the table's macro does this.
    pub(super) const fn described(mut self, group: &'static str, meaning: &'static str) -> Self {
        self.group = group;
        self.meaning = meaning;
        self
    }
}

const fn field(
    high: u16,
    low: u16,
    name: &'static str,
    meaning: &'static str,
    form: Form,
) -> Field {
    Field { high, low, name, meaning, values: &[], form, unit: "", ecat: None }
}

/// A field of one bit.
pub(crate) const fn flag(bit: u16, name: &'static str, meaning: &'static str) -> Field {
    field(bit, bit, name, meaning, Form::Flag)
}

/// A field whose values have names.
pub(crate) const fn choice(
    high: u16,
    low: u16,
    name: &'static str,
    meaning: &'static str,
    values: &'static [(u32, &'static str)],
) -> Field {
    let mut choice = field(high, low, name, meaning, Form::Choice);
    choice.values = values;
    choice
}

/// A field that is a number in `unit`.
pub(super) const fn number(
    high: u16,
    low: u16,
    name: &'static str,
    meaning: &'static str,
    unit: &'static str,
) -> Field {
    let mut number = field(high, low, name, meaning, Form::Decimal);
    number.unit = unit;
    number
}

/// A field that is read in hexadecimal.
pub(super) const fn hex(high: u16, low: u16, name: &'static str, meaning: &'static str) -> Field {
    field(high, low, name, meaning, Form::Hex)
}

/// A field that is a run of bytes.
pub(super) const fn bytes(high: u16, low: u16, name: &'static str, meaning: &'static str) -> Field {
    field(high, low, name, meaning, Form::Bytes)
}

impl Field {
    /// Writes it in another form.
    pub(super) const fn form(mut self, form: Form) -> Self {
        self.form = form;
        self
    }

    /// Gives it a right of its own for the EtherCAT side.
    pub(super) const fn ecat(mut self, access: Access) -> Self {
        self.ecat = Some(access);
        self
    }
}
