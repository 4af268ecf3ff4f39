//! Parser of expressions, by recursive descent: `!` binds tightest, then `&&`, `^^`, `||`.

use std::ops::{Range, RangeInclusive};

use linesman_proto::time::Span;

use super::error::ExpressionError;
use super::field::{FieldReference, nearest};
use super::node::{Around, ExpressionNode, Leaf, Relation, SubDeviceWord, Test, Unresolved};
use super::token::{ExpressionToken, TokenKind, tokens};
use super::value::{ValueKind, nanoseconds, number};

/// Brackets and negations within each other, at most.
const MOST_NESTED: usize = 64;

/// The tree of a text.
pub(super) fn parse(text: &str) -> Result<ExpressionNode, ExpressionError> {
    let mut parser = ExpressionParser { tokens: tokens(text)?, next: 0, depth: 0 };
    if parser.peek().kind == TokenKind::End {
        let advice = "write a condition, such as ecat.cmd == \"LRW\" && ecat.cnt < 3";
        return Err(ExpressionError::new(0..0, "the expression is empty", advice));
    }
    let node = parser.any_of()?;
    let rest = parser.peek().clone();
    if rest.kind == TokenKind::End {
        return Ok(node);
    }
    let reason = format!("expected && or || or the end, received {}", shown(&rest.kind));
    Err(ExpressionError::new(rest.at, reason, rest_advice(&rest.kind)))
}

fn rest_advice(kind: &TokenKind) -> &'static str {
    match kind {
        TokenKind::Sign("=") => "compare by ==",
        TokenKind::Sign("|") => "write || or `or`",
        TokenKind::Sign("^") => "write ^^ or `xor`",
        TokenKind::Sign(")" | "}") => "leave it out, or open the bracket before",
        TokenKind::Word(word) if word.chars().all(|letter| letter.is_ascii_uppercase()) => {
            "write operators in small letters: and, or, not, in"
        }
        TokenKind::Word(_) | TokenKind::Text(_) | TokenKind::Sign(_) | TokenKind::End => {
            "join conditions by && or ||"
        }
    }
}

/// A token in a message.
fn shown(kind: &TokenKind) -> String {
    match kind {
        TokenKind::Word(word) => format!("`{word}`"),
        TokenKind::Text(text) => format!("\"{text}\""),
        TokenKind::Sign(sign) => format!("`{sign}`"),
        TokenKind::End => "the end".to_owned(),
    }
}

struct ExpressionParser {
    tokens: Vec<ExpressionToken>,
    next: usize,
    depth: usize,
}

/// A comparison by its sign or word: how values compare, whether all values must, whether outside.
const COMPARISONS: [(&str, Relation, bool, bool); 16] = [
    ("==", Relation::Equal, false, false),
    ("eq", Relation::Equal, false, false),
    ("!=", Relation::Equal, true, true),
    ("ne", Relation::Equal, true, true),
    ("===", Relation::Equal, true, false),
    ("!==", Relation::Equal, false, true),
    ("~=", Relation::Equal, false, true),
    ("<", Relation::Less, false, false),
    ("lt", Relation::Less, false, false),
    ("<=", Relation::LessOrEqual, false, false),
    ("le", Relation::LessOrEqual, false, false),
    (">", Relation::Greater, false, false),
    ("gt", Relation::Greater, false, false),
    (">=", Relation::GreaterOrEqual, false, false),
    ("ge", Relation::GreaterOrEqual, false, false),
    ("is", Relation::Equal, false, false),
];

impl ExpressionParser {
    fn peek(&self) -> &ExpressionToken {
        // The last token is the end, and is never passed.
        &self.tokens[self.next.min(self.tokens.len() - 1)]
    }

    fn take(&mut self) -> ExpressionToken {
        let token = self.peek().clone();
        self.next = (self.next + 1).min(self.tokens.len() - 1);
        token
    }

    /// Passes a sign or word, if it is there.
    fn takes(&mut self, sign: &str, word: &str) -> bool {
        let is_it = match &self.peek().kind {
            TokenKind::Sign(found) => *found == sign && !sign.is_empty(),
            TokenKind::Word(found) => found == word && !word.is_empty(),
            TokenKind::Text(_) | TokenKind::End => false,
        };
        if is_it {
            self.take();
        }
        is_it
    }

    fn expect(&mut self, sign: &str, where_to: &str) -> Result<Range<usize>, ExpressionError> {
        let token = self.peek().clone();
        if self.takes(sign, "") {
            return Ok(token.at);
        }
        let reason = format!("expected `{sign}` {where_to}, received {}", shown(&token.kind));
        Err(ExpressionError::new(token.at, reason, format!("put `{sign}` there")))
    }

    /// Parts that are joined by one operator.
    fn joined(
        &mut self,
        (sign, word): (&str, &str),
        part: fn(&mut Self) -> Result<ExpressionNode, ExpressionError>,
        join: fn(Vec<ExpressionNode>) -> ExpressionNode,
    ) -> Result<ExpressionNode, ExpressionError> {
        let first = part(self)?;
        let mut parts = vec![first];
        while self.takes(sign, word) {
            parts.push(part(self)?);
        }
        let only = if parts.len() == 1 { parts.pop() } else { None };
        Ok(only.unwrap_or_else(|| join(parts)))
    }

    fn any_of(&mut self) -> Result<ExpressionNode, ExpressionError> {
        self.joined(("||", "or"), Self::one_of, ExpressionNode::Or)
    }

    fn one_of(&mut self) -> Result<ExpressionNode, ExpressionError> {
        self.joined(("^^", "xor"), Self::all_of, ExpressionNode::Xor)
    }

    fn all_of(&mut self) -> Result<ExpressionNode, ExpressionError> {
        self.joined(("&&", "and"), Self::negated, ExpressionNode::And)
    }

    fn negated(&mut self) -> Result<ExpressionNode, ExpressionError> {
        let at = self.peek().at.clone();
        if self.takes("!", "not") {
            let part = self.nested(at, Self::negated)?;
            return Ok(ExpressionNode::Not(Box::new(part)));
        }
        self.condition()
    }

    /// Something that may hold more of its kind.
    fn nested(
        &mut self,
        at: Range<usize>,
        part: fn(&mut Self) -> Result<ExpressionNode, ExpressionError>,
    ) -> Result<ExpressionNode, ExpressionError> {
        self.depth += 1;
        if self.depth > MOST_NESTED {
            let reason = format!("brackets and negations nest deeper than {MOST_NESTED}");
            return Err(ExpressionError::new(at, reason, "write it with fewer brackets"));
        }
        let node = part(self);
        self.depth -= 1;
        node
    }

    fn condition(&mut self) -> Result<ExpressionNode, ExpressionError> {
        let token = self.take();
        match &token.kind {
            TokenKind::Sign("(") => {
                let inner = self.nested(token.at, Self::any_of)?;
                self.expect(")", "after the condition in brackets")?;
                Ok(inner)
            }
            TokenKind::Word(word) if word == "datagram" => {
                self.expect("(", "after `datagram`")?;
                let inner = self.nested(token.at, Self::any_of)?;
                self.expect(")", "after the condition on a datagram")?;
                Ok(ExpressionNode::OneDatagram(Box::new(inner)))
            }
            TokenKind::Word(word) if word == "around" => self.around(),
            TokenKind::Word(word) if word == "any" || word == "all" => {
                let (all, field) = (word == "all", self.take());
                self.field(&field, Some(all))
            }
            TokenKind::Word(word) if number(word).is_some() => self.mirrored(&token),
            TokenKind::Word(_) => self.field(&token, None),
            TokenKind::Text(_) | TokenKind::Sign(_) | TokenKind::End => {
                let reason = format!("expected a field, received {}", shown(&token.kind));
                let advice = "begin a condition with a field, such as ecat.cmd; \
                              `linesman capture filter --fields` lists them";
                Err(ExpressionError::new(token.at, reason, advice))
            }
        }
    }

    /// `3 < ecat.cnt`: the same as `ecat.cnt > 3`.
    fn mirrored(&mut self, value: &ExpressionToken) -> Result<ExpressionNode, ExpressionError> {
        let sign = self.take();
        let turned = match &sign.kind {
            TokenKind::Sign("<") => ">",
            TokenKind::Sign("<=") => ">=",
            TokenKind::Sign(">") => "<",
            TokenKind::Sign(">=") => "<=",
            TokenKind::Sign(same @ ("==" | "!=")) => same,
            TokenKind::Word(_) | TokenKind::Text(_) | TokenKind::Sign(_) | TokenKind::End => {
                let reason = format!(
                    "expected a comparison behind {}, received {}",
                    shown(&value.kind),
                    shown(&sign.kind)
                );
                let advice = "write the field first: ecat.cnt == 3";
                return Err(ExpressionError::new(sign.at, reason, advice));
            }
        };
        let field = self.take();
        let reference = self.reference(&field)?;
        let leaf = self.compared(&field, reference, None, turned, value.clone())?;
        Ok(ExpressionNode::Leaf(leaf))
    }

    fn reference(&self, token: &ExpressionToken) -> Result<FieldReference, ExpressionError> {
        let TokenKind::Word(name) = &token.kind else {
            let reason = format!("expected a field, received {}", shown(&token.kind));
            return Err(ExpressionError::new(token.at.clone(), reason, "name a field there"));
        };
        FieldReference::named(name).ok_or_else(|| {
            let reason = format!("`{name}` is no field");
            let list = "`linesman capture filter --fields` lists them";
            let advice = match nearest(name) {
                Some(near) => format!("did you mean {near}? {list}"),
                None => list.to_owned(),
            };
            ExpressionError::new(token.at.clone(), reason, advice)
        })
    }

    /// A condition on a field: that it is there, or on its values.
    fn field(
        &mut self,
        token: &ExpressionToken,
        all: Option<bool>,
    ) -> Result<ExpressionNode, ExpressionError> {
        let reference = self.reference(token)?;
        if self.takes("", "in") {
            return self.within(token, reference, all).map(ExpressionNode::Leaf);
        }
        let before = self.next;
        if self.takes("", "not") {
            if self.takes("", "in") {
                let within = self.within(token, reference, all)?;
                return Ok(ExpressionNode::Not(Box::new(ExpressionNode::Leaf(within))));
            }
            self.next = before;
        }
        self.tested(token, reference, all).map(ExpressionNode::Leaf)
    }

    /// A condition on a field that is no set.
    fn tested(
        &mut self,
        token: &ExpressionToken,
        reference: FieldReference,
        all: Option<bool>,
    ) -> Result<Leaf, ExpressionError> {
        if self.takes("&", "") {
            return self.masked(token, reference, all);
        }
        match self.comparison() {
            Some(sign) => {
                let value = self.take();
                self.compared(token, reference, all, sign, value)
            }
            None if all.is_some() => {
                let reason = "`any` and `all` need a comparison".to_owned();
                Err(ExpressionError::new(token.at.clone(), reason, "write: all ecat.cnt == 1"))
            }
            None => Ok(Leaf::Exists(reference)),
        }
    }

    /// Passes a comparison, if there is one.
    fn comparison(&mut self) -> Option<&'static str> {
        let found = COMPARISONS.iter().find(|(sign, ..)| match &self.peek().kind {
            TokenKind::Sign(found) => found == sign,
            TokenKind::Word(found) => found == sign,
            TokenKind::Text(_) | TokenKind::End => false,
        });
        let sign = found.map(|(sign, ..)| *sign)?;
        self.take();
        Some(sign)
    }

    fn compared(
        &self,
        field: &ExpressionToken,
        reference: FieldReference,
        all: Option<bool>,
        sign: &str,
        value: ExpressionToken,
    ) -> Result<Leaf, ExpressionError> {
        refuse_presence(field, reference)?;
        let row = COMPARISONS.iter().find(|(known, ..)| *known == sign);
        let (comparison, is_all, outside) = row
            .map_or((Relation::Equal, false, false), |(_, comparison, all, outside)| {
                (*comparison, *all, *outside)
            });
        let all = all.unwrap_or(is_all);
        let mut test = Test { reference, mask: None, ranges: Vec::new(), all, outside };
        if reference.field.kind == ValueKind::SubDevice {
            let words = vec![(device_word(&value)?, None)];
            return Ok(Leaf::SubDevices(Unresolved { test, comparison, words }));
        }
        test.ranges.push(comparison.range(value_of(&value, reference)?));
        Ok(Leaf::Values(test))
    }

    /// `ecat.int & 0x04`, and what it equals if that is said.
    fn masked(
        &mut self,
        field: &ExpressionToken,
        reference: FieldReference,
        all: Option<bool>,
    ) -> Result<Leaf, ExpressionError> {
        refuse_presence(field, reference)?;
        let value = self.take();
        let mask = Some(value_of(&value, reference)?);
        let test = |ranges: Vec<RangeInclusive<i128>>, all, outside| {
            Leaf::Values(Test { reference, mask, ranges, all, outside })
        };
        let Some(sign) = self.comparison() else {
            return Ok(test(vec![0..=0], all.unwrap_or(false), true));
        };
        let operand = self.take();
        match self.compared(field, reference, all, sign, operand)? {
            Leaf::Values(compared) => Ok(test(compared.ranges, compared.all, compared.outside)),
            other @ (Leaf::Exists(_) | Leaf::SubDevices(_) | Leaf::Around(_)) => Ok(other),
        }
    }

    /// `{1, 4..7}` behind `in`.
    fn within(
        &mut self,
        field: &ExpressionToken,
        reference: FieldReference,
        all: Option<bool>,
    ) -> Result<Leaf, ExpressionError> {
        refuse_presence(field, reference)?;
        self.expect("{", "after `in`")?;
        let (all, outside) = (all.unwrap_or(false), false);
        let mut test = Test { reference, mask: None, ranges: Vec::new(), all, outside };
        let mut words = Vec::new();
        loop {
            let from = self.take();
            let to = self.takes("..", "").then(|| self.take());
            if reference.field.kind == ValueKind::SubDevice {
                let last = to.as_ref().map(device_word).transpose()?;
                words.push((device_word(&from)?, last));
            } else {
                let first = value_of(&from, reference)?;
                let last = to.as_ref().map_or(Ok(first), |to| value_of(to, reference))?;
                if last < first {
                    let at = from.at.start..to.map_or(from.at.end, |to| to.at.end);
                    let reason = "the range ends before it begins";
                    return Err(ExpressionError::new(at, reason, "name the lower value first"));
                }
                test.ranges.push(first..=last);
            }
            if self.takes(",", "") {
                continue;
            }
            self.expect("}", "after the values, which commas part")?;
            break;
        }
        if reference.field.kind == ValueKind::SubDevice {
            let comparison = Relation::Equal;
            return Ok(Leaf::SubDevices(Unresolved { test, comparison, words }));
        }
        Ok(Leaf::Values(test))
    }

    /// `around(F2, 5ms)`.
    fn around(&mut self) -> Result<ExpressionNode, ExpressionError> {
        self.expect("(", "after `around`")?;
        let token = self.take();
        let (TokenKind::Word(finding) | TokenKind::Text(finding)) = token.kind else {
            let reason = format!("expected a finding, received {}", shown(&token.kind));
            let advice = "name it by its number (F2), code (H110) or name, or write any";
            return Err(ExpressionError::new(token.at, reason, advice));
        };
        self.expect(",", "between the finding and the time around it")?;
        let time = self.take();
        let nanos = match &time.kind {
            TokenKind::Word(word) => nanoseconds(word).and_then(|nanos| u64::try_from(nanos).ok()),
            TokenKind::Text(_) | TokenKind::Sign(_) | TokenKind::End => None,
        };
        let Some(nanos) = nanos else {
            let reason = format!("expected a time, received {}", shown(&time.kind));
            return Err(ExpressionError::new(time.at, reason, "write 5ms, 200us or 0.5"));
        };
        self.expect(")", "after the time")?;
        let around = Around { finding, at: token.at, span: Span::ns(nanos), windows: None };
        Ok(ExpressionNode::Leaf(Leaf::Around(around)))
    }
}

/// A field that is there or not has no value to compare.
fn refuse_presence(
    token: &ExpressionToken,
    reference: FieldReference,
) -> Result<(), ExpressionError> {
    let field = reference.field;
    if field.kind != ValueKind::Presence {
        return Ok(());
    }
    let reason = format!("`{}` has no values: it is there or not", field.name);
    let advice = format!("write {} alone, or !{}", field.name, field.name);
    Err(ExpressionError::new(token.at.clone(), reason, advice))
}

/// The value that a token means for a field.
fn value_of(token: &ExpressionToken, reference: FieldReference) -> Result<i128, ExpressionError> {
    let field = reference.field;
    let word = match &token.kind {
        TokenKind::Word(word) | TokenKind::Text(word) => Some(word),
        TokenKind::Sign(_) | TokenKind::End => None,
    };
    word.and_then(|word| field.kind.value(word)).ok_or_else(|| {
        let reason = format!("{} does not fit {}", shown(&token.kind), field.name);
        let advice = format!("write {}", field.kind.expected());
        ExpressionError::new(token.at.clone(), reason, advice)
    })
}

/// The word that names a SubDevice.
fn device_word(token: &ExpressionToken) -> Result<SubDeviceWord, ExpressionError> {
    match &token.kind {
        TokenKind::Word(word) | TokenKind::Text(word) => {
            Ok(SubDeviceWord { word: word.clone(), at: token.at.clone() })
        }
        TokenKind::Sign(_) | TokenKind::End => {
            let reason = format!("expected a SubDevice, received {}", shown(&token.kind));
            let advice = format!("write {}", ValueKind::SubDevice.expected());
            Err(ExpressionError::new(token.at.clone(), reason, advice))
        }
    }
}
