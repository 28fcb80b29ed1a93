//! What a source file names: its paths, and whether it holds `unsafe`.
//!
//! A scanner of tokens, not a parser: `use` trees and qualified paths look alike wherever they stand. Comments, strings
//! and what only `cfg(test)` compiles do not count.

use crate::tokens::{Token, tokens};

/// What one file names.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Mentions {
    /// Paths as segments; those into the library begin with `crate`, however they were written.
    pub(crate) paths: Vec<Vec<String>>,
    /// Whether the keyword `unsafe` occurs.
    pub(crate) has_unsafe: bool,
}

/// Scans a file whose own module lies `depth` levels below the root of its crate.
pub(crate) fn mentions(source: &str, depth: usize) -> Mentions {
    let mut scan = Scan { tokens: without_tests(&tokens(source)), at: 0, depth, braces: 0, modules: Vec::new() };
    let mut found = Mentions::default();
    while let Some(token) = scan.peek(0).cloned() {
        match token {
            Token::Word(word) => {
                found.has_unsafe |= word == "unsafe";
                scan.read_word(&word, &mut found.paths);
            }
            Token::Mark(mark) => scan.read_mark(mark),
            Token::PathSeparator => scan.at += 1,
        }
    }
    found
}

struct Scan {
    tokens: Vec<Token>,
    at: usize,
    depth: usize,
    braces: usize,
    /// Open braces at the start of each inline module around.
    modules: Vec<usize>,
}

impl Scan {
    fn peek(&self, ahead: usize) -> Option<&Token> {
        self.tokens.get(self.at + ahead)
    }

    fn read_mark(&mut self, mark: char) {
        self.at += 1;
        match mark {
            '{' => self.braces += 1,
            '}' => {
                self.braces = self.braces.saturating_sub(1);
                self.modules.pop_if(|opened| *opened > self.braces);
            }
            _ => {}
        }
    }

    fn read_word(&mut self, word: &str, found: &mut Vec<Vec<String>>) {
        let follows = |wanted: &str| matches!(self.peek(1), Some(Token::Word(next)) if next == wanted);
        if word == "mod" && self.peek(2) == Some(&Token::Mark('{')) {
            self.modules.push(self.braces + 1);
            self.at += 2;
            return;
        }
        let import = match word {
            "use" => 1,
            "extern" if follows("crate") => 2,
            _ => 0,
        };
        self.at += import;
        let mut paths = Vec::new();
        self.read_tree(&[], &mut paths);
        // A single word is a path where something is imported; elsewhere it is a variable, a field, a keyword.
        let paths = paths.into_iter().filter(|path| import > 0 || path.len() > 1);
        found.extend(paths.map(|path| from_root(path, self.depth + self.modules.len())));
    }

    /// Reads `a::b`, `a::*`, `a::{b, c::d}`, `{a, b}`; each of its ends becomes a path behind `prefix`.
    fn read_tree(&mut self, prefix: &[String], found: &mut Vec<Vec<String>>) {
        let mut path = prefix.to_vec();
        loop {
            match self.peek(0).cloned() {
                Some(Token::PathSeparator) => self.at += 1,
                Some(Token::Word(word)) => {
                    self.at += 1;
                    path.push(word);
                    if self.peek(0) != Some(&Token::PathSeparator) {
                        break;
                    }
                }
                Some(Token::Mark('*')) if path.len() > prefix.len() => {
                    self.at += 1;
                    path.push("*".to_owned());
                    break;
                }
                Some(Token::Mark('{')) => return self.read_group(&path, found),
                _ => break,
            }
        }
        if path.len() > prefix.len() {
            found.push(path);
        }
    }

    fn read_group(&mut self, prefix: &[String], found: &mut Vec<Vec<String>>) {
        self.at += 1;
        while let Some(token) = self.peek(0).cloned() {
            match token {
                Token::Mark('}') => {
                    self.at += 1;
                    return;
                }
                Token::Mark('*') => {
                    self.at += 1;
                    found.push([prefix, &["*".to_owned()]].concat());
                }
                Token::Mark('{') | Token::Word(_) | Token::PathSeparator => self.read_tree(prefix, found),
                Token::Mark(_) => self.at += 1,
            }
        }
    }
}

/// Writes `super::super::x` as `crate::x` where it climbs to the root of the crate.
fn from_root(path: Vec<String>, depth: usize) -> Vec<String> {
    let inside = path.iter().skip_while(|segment| *segment == "self");
    let climbed = inside.clone().take_while(|segment| *segment == "super").count();
    if climbed == 0 || climbed < depth {
        return path;
    }
    std::iter::once("crate".to_owned()).chain(inside.skip(climbed).cloned()).collect()
}

/// Leaves out every item behind `#[cfg(test)]`.
fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let attribute = self::tokens("#[cfg(test)]");
    let mut kept = Vec::new();
    let mut at = 0;
    while at < tokens.len() {
        if tokens[at..].starts_with(&attribute) {
            at += attribute.len();
            at += item_len(&tokens[at..]);
        } else {
            kept.push(tokens[at].clone());
            at += 1;
        }
    }
    kept
}

/// Tokens up to the semicolon or the closing brace that ends an item.
fn item_len(tokens: &[Token]) -> usize {
    let mut open = 0_usize;
    for (at, token) in tokens.iter().enumerate() {
        match token {
            Token::Mark('{' | '(' | '[') => open += 1,
            Token::Mark(closing @ ('}' | ')' | ']')) => {
                open = open.saturating_sub(1);
                if open == 0 && *closing == '}' {
                    return at + 1;
                }
            }
            Token::Mark(';') if open == 0 => return at + 1,
            _ => {}
        }
    }
    tokens.len()
}
