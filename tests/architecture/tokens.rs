//! Words, path separators and marks of a Rust source; comments, strings, characters and numbers are left out.

/// A piece of a source that a path can be made of, or that ends one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token {
    /// Identifier or keyword.
    Word(String),
    /// `::`
    PathSeparator,
    /// Any other character.
    Mark(char),
}

/// The tokens of a source that compiles.
pub(crate) fn tokens(source: &str) -> Vec<Token> {
    let mut found = Vec::new();
    let mut rest = source;
    while let Some(first) = rest.chars().next() {
        let skipped = skipped_len(rest, first);
        if skipped > 0 {
            rest = &rest[skipped..];
        } else if let Some(after) = rest.strip_prefix("::") {
            found.push(Token::PathSeparator);
            rest = after;
        } else if is_word(first) {
            let text = rest.strip_prefix("r#").unwrap_or(rest);
            let end = text.find(|c| !is_word(c)).unwrap_or(text.len());
            if !first.is_ascii_digit() {
                found.push(Token::Word(text[..end].to_owned()));
            }
            rest = &text[end..];
        } else {
            found.push(Token::Mark(first));
            rest = &rest[first.len_utf8()..];
        }
    }
    found
}

fn is_word(character: char) -> bool {
    character.is_alphanumeric() || character == '_'
}

/// Bytes at the start of `rest` that name nothing: white space, comment, string, character, lifetime.
fn skipped_len(rest: &str, first: char) -> usize {
    match first {
        _ if first.is_whitespace() => first.len_utf8(),
        _ if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
        _ if rest.starts_with("/*") => block_comment_len(rest),
        '"' => string_len(rest),
        '\'' => quote_len(rest),
        'r' | 'b' | 'c' => prefixed_string_len(rest),
        _ => 0,
    }
}

/// Block comments nest.
fn block_comment_len(rest: &str) -> usize {
    let mut open = 0_usize;
    let mut at = 0;
    while at < rest.len() {
        let (step, change) = match &rest.as_bytes()[at..] {
            [b'/', b'*', ..] => (2, 1),
            [b'*', b'/', ..] => (2, -1),
            _ => (1, 0),
        };
        at += step;
        open = open.saturating_add_signed(change);
        if open == 0 {
            return at;
        }
    }
    rest.len()
}

/// A string with escapes, from its opening to behind its closing quote.
fn string_len(rest: &str) -> usize {
    let mut escaped = false;
    for (at, byte) in rest.bytes().enumerate().skip(1) {
        match byte {
            b'"' if !escaped => return at + 1,
            b'\\' => escaped = !escaped,
            _ => escaped = false,
        }
    }
    rest.len()
}

/// A character (`'x'`, `'\n'`) or a lifetime (`'a`).
fn quote_len(rest: &str) -> usize {
    let inner = &rest[1..];
    if inner.starts_with('\\') {
        // The character behind the backslash may be the quote itself.
        return inner.get(2..).and_then(|tail| tail.find('\'')).map_or(rest.len(), |end| 1 + 2 + end + 1);
    }
    let len = inner.chars().next().map_or(0, char::len_utf8);
    1 + if inner[len..].starts_with('\'') { len + 1 } else { 0 }
}

/// Strings with a prefix: `r"…"`, `r#"…"#`, `b"…"`, `br"…"`, `c"…"`, `b'…'`; 0 if it is none.
fn prefixed_string_len(rest: &str) -> usize {
    let prefix = rest.find(|c| !matches!(c, 'r' | 'b' | 'c')).unwrap_or(rest.len());
    if !matches!(&rest[..prefix], "r" | "b" | "c" | "br" | "cr") {
        return 0;
    }
    let body = &rest[prefix..];
    let hashes = body.bytes().take_while(|byte| *byte == b'#').count();
    match body.as_bytes().get(hashes) {
        Some(b'"') if rest[..prefix].contains('r') => {
            let closing = format!("\"{}", "#".repeat(hashes));
            let inside = prefix + hashes + 1;
            rest[inside..].find(&closing).map_or(rest.len(), |end| inside + end + closing.len())
        }
        Some(b'"') if hashes == 0 => prefix + string_len(body),
        Some(b'\'') if hashes == 0 && &rest[..prefix] == "b" => prefix + quote_len(body),
        _ => 0,
    }
}
