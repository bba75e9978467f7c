//! The text of a script as names, texts and signs, without comments. It is enough to find what must not be there, and what a script has.

/// A part of a script.
pub(crate) enum Token<'a> {
    /// A name or a word of the language.
    Name(&'a [u8]),
    /// What stands between quotation marks.
    Text(&'a [u8]),
    /// Any other character.
    Sign(u8),
}

/// Splits a text.
#[derive(Clone)]
pub(crate) struct Tokens<'a> {
    text: &'a [u8],
    at: usize,
    /// The braces that are open: whether each is within a text between backticks.
    braces: Vec<bool>,
}

impl<'a> Iterator for Tokens<'a> {
    type Item = Token<'a>;

    fn next(&mut self) -> Option<Token<'a>> {
        loop {
            let first = self.peek(0)?;
            if first.is_ascii_whitespace() {
                self.at += 1;
            } else if first == b'-' && self.peek(1) == Some(b'-') {
                self.at += 2;
                if self.long_bracket().is_none() {
                    self.skip_until(|byte| byte == b'\n');
                }
            } else {
                return Some(self.token(first));
            }
        }
    }
}

impl<'a> Tokens<'a> {
    /// The tokens of a script.
    pub fn new(text: &'a [u8]) -> Self {
        Self { text, at: 0, braces: Vec::new() }
    }

    /// What comes after the latest token.
    pub fn rest(&self) -> &'a [u8] {
        &self.text[self.at..]
    }

    /// Goes on with this end of the text.
    pub fn skip_to(&mut self, rest: &[u8]) {
        self.at = self.text.len() - rest.len();
    }

    /// The number of the line that has been reached.
    pub fn line(&self) -> usize {
        1 + memchr::memchr_iter(b'\n', &self.text[..self.at]).count()
    }

    fn token(&mut self, first: u8) -> Token<'a> {
        let begin = self.at;
        match first {
            b'"' | b'\'' => {
                self.at += 1;
                self.skip_text(&[first, b'\n']);
                let end = self.at;
                self.at = (end + 1).min(self.text.len());
                Token::Text(self.text.get(begin + 1..end).unwrap_or_default())
            }
            b'`' => {
                self.at += 1;
                self.interpolated()
            }
            b'[' => match self.long_bracket() {
                Some(text) => Token::Text(text),
                None => self.sign(first),
            },
            b'{' => {
                self.braces.push(false);
                self.sign(first)
            }
            b'}' => {
                let sign = self.sign(first);
                // The rest of the text goes on behind an expression in it.
                if self.braces.pop() == Some(true) { self.interpolated() } else { sign }
            }
            first if is_of_name(first) => {
                self.skip_until(|byte| !is_of_name(byte));
                Token::Name(&self.text[begin..self.at])
            }
            first => self.sign(first),
        }
    }

    fn sign(&mut self, sign: u8) -> Token<'a> {
        self.at += 1;
        Token::Sign(sign)
    }

    /// Passes over a text between backticks, up to its end or to an expression in it.
    fn interpolated(&mut self) -> Token<'a> {
        let begin = self.at;
        self.skip_text(b"`{");
        let text = &self.text[begin.min(self.at)..self.at];
        if self.peek(0) == Some(b'{') {
            self.braces.push(true);
        }
        self.at = (self.at + 1).min(self.text.len());
        Token::Text(text)
    }

    /// Passes over a text to one of the characters that end it.
    fn skip_text(&mut self, ends: &[u8]) {
        while let Some(byte) = self.peek(0).filter(|byte| !ends.contains(byte)) {
            self.at += if byte == b'\\' { 2 } else { 1 };
        }
        self.at = self.at.min(self.text.len());
    }

    /// Passes over `[[ ... ]]` or `[=[ ... ]=]`, and returns what it holds; nothing if none begins here.
    fn long_bracket(&mut self) -> Option<&'a [u8]> {
        let level = (1..).take_while(|&ahead| self.peek(ahead) == Some(b'=')).count();
        if self.peek(0) != Some(b'[') || self.peek(level + 1) != Some(b'[') {
            return None;
        }
        let begin = self.at + level + 2;
        let end: Vec<u8> = [&b"]"[..], &vec![b'='; level], b"]"].concat();
        let length = memchr::memmem::find(&self.text[begin..], &end);
        let length = length.unwrap_or(self.text.len() - begin);
        self.at = (begin + length + end.len()).min(self.text.len());
        Some(&self.text[begin..begin + length])
    }

    fn skip_until(&mut self, end: impl Fn(u8) -> bool) {
        while self.peek(0).is_some_and(|byte| !end(byte)) {
            self.at += 1;
        }
    }

    fn peek(&self, ahead: usize) -> Option<u8> {
        self.text.get(self.at + ahead).copied()
    }
}

fn is_of_name(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte >= 128
}
