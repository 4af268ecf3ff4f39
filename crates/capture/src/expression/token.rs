//! Words and signs of an expression, each with its place in the text.

use std::ops::Range;

use super::error::ExpressionError;

/// A word or sign.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum TokenKind {
    /// A name, number, address or operator in letters.
    Word(String),
    /// Something in quotation marks.
    Text(String),
    /// An operator or bracket.
    Sign(&'static str),
    /// The end of the text.
    End,
}

/// A word or sign at its place, in bytes of the text.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct ExpressionToken {
    pub(super) kind: TokenKind,
    pub(super) at: Range<usize>,
}

/// Signs, longer ones before those that they begin with.
const SIGNS: [&str; 23] = [
    "===", "!==", "==", "!=", "~=", ">=", "<=", "&&", "||", "^^", "..", ">", "<", "!", "&", "(",
    ")", "{", "}", ",", "=", "|", "^",
];

/// Takes a text apart; the last token is its end.
pub(super) fn tokens(text: &str) -> Result<Vec<ExpressionToken>, ExpressionError> {
    let mut all = Vec::new();
    let mut at = 0;
    while let Some(letter) = text[at..].chars().next() {
        if letter.is_whitespace() {
            at += letter.len_utf8();
            continue;
        }
        let token = next(text, at, letter)?;
        at = token.at.end;
        all.push(token);
    }
    all.push(ExpressionToken { kind: TokenKind::End, at: text.len()..text.len() });
    Ok(all)
}

fn next(text: &str, at: usize, letter: char) -> Result<ExpressionToken, ExpressionError> {
    let rest = &text[at..];
    if letter == '"' || letter == '\'' {
        let inner = &rest[1..];
        let Some(len) = inner.find(letter) else {
            let reason = format!("the text that begins here has no closing {letter}");
            return Err(ExpressionError::new(at..text.len(), reason, "close the quotation marks"));
        };
        let kind = TokenKind::Text(inner[..len].to_owned());
        return Ok(ExpressionToken { kind, at: at..at + len + 2 });
    }
    let len = word_len(rest);
    if len > 0 {
        return Ok(ExpressionToken {
            kind: TokenKind::Word(rest[..len].to_owned()),
            at: at..at + len,
        });
    }
    match SIGNS.iter().find(|sign| rest.starts_with(**sign)) {
        Some(sign) => Ok(ExpressionToken { kind: TokenKind::Sign(sign), at: at..at + sign.len() }),
        None => {
            let place = at..at + letter.len_utf8();
            let reason = format!("`{letter}` has no meaning here");
            let advice = "put names and texts into quotation marks: subdevice == \"Term 4\"";
            Err(ExpressionError::new(place, reason, advice))
        }
    }
}

/// Length of the word in front; a range of numbers (`4..7`) is two words with a sign between them.
fn word_len(text: &str) -> usize {
    let is_inner = |letter: char| letter.is_alphanumeric() || "_.:-".contains(letter);
    let len = text.find(|letter| !is_inner(letter)).unwrap_or(text.len());
    let word = &text[..len];
    let len = word.find("..").unwrap_or(len);
    // A sign in front belongs to a number alone.
    let begins = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == '-';
    if word.chars().next().is_some_and(begins) { len } else { 0 }
}
