//! MessagePack-RPC as CARLA's server (rpclib) speaks it: messages without frames around them, one behind the other.

use std::io::{self, Read};

use pdk_adapter::{Connection, Deadline};
use pdk_sdk::prelude::{Error, ErrorKind, Result};
use rmpv::Value;

use crate::value::{array, element, elements, text};

/// The longest answer in bytes: the map of a whole region as OpenDRIVE.
pub const LONGEST: usize = 64 << 20;

/// The connection for requests and answers.
#[derive(Debug)]
pub struct Rpc {
    connection: Connection,
    /// The number of the next request.
    next: u32,
}

/// A request as it goes over the wire. With `no_answer` the request says that no answer is wanted.
pub fn request(number: u32, name: &str, no_answer: bool, arguments: Vec<Value>) -> Vec<u8> {
    let mut all = vec![array([Value::Boolean(no_answer)])];
    all.extend(arguments);
    let message = array([0.into(), number.into(), name.into(), Value::Array(all)]);
    let mut bytes = Vec::new();
    match rmpv::encode::write_value(&mut bytes, &message) {
        Ok(()) => bytes,
        Err(error) => unreachable!("memory takes every byte: {error}"),
    }
}

impl Rpc {
    /// Takes a connection.
    pub fn new(connection: Connection) -> Self {
        Self { connection, next: 0 }
    }

    /// As the server is named to users.
    pub fn peer(&self) -> &str {
        self.connection.peer()
    }

    /// Whether the connection still stands.
    pub fn is_open(&mut self) -> bool {
        self.connection.has_bytes(1).is_ok()
    }

    /// Sends a request and returns its number, which its answer carries.
    ///
    /// # Errors
    /// If the server is gone or takes nothing.
    pub fn send(&mut self, name: &str, arguments: Vec<Value>, deadline: &Deadline) -> Result<u32> {
        let number = self.next;
        self.next = self.next.wrapping_add(1);
        self.connection.send(&request(number, name, false, arguments), deadline)?;
        Ok(number)
    }

    /// The answer to request `number`, whose name was `name`; an answer that is no longer waited for is dropped.
    ///
    /// # Errors
    /// If the server is gone, does not answer in time, answers what is not an answer, or refuses the request.
    pub fn answer(&mut self, number: u32, name: &str, deadline: &Deadline) -> Result<Value> {
        loop {
            let message = self.message(name, deadline)?;
            if element(&message, 1).as_u64() != Some(number.into()) {
                continue;
            }
            let refused = element(&message, 2);
            if !refused.is_nil() {
                return Err(Error::of(
                    ErrorKind::Configuration,
                    format!(
                        "{} does not know the request `{name}` as CARLA 0.9.13 to 0.9.16 do ({}); start one of these",
                        self.peer(),
                        said(refused)
                    ),
                ));
            }
            return self.unwrapped(name, element(&message, 3));
        }
    }

    /// Sends a request and waits for its answer.
    ///
    /// # Errors
    /// As [`Rpc::send`] and [`Rpc::answer`].
    pub fn call(&mut self, name: &str, arguments: Vec<Value>, deadline: &Deadline) -> Result<Value> {
        let number = self.send(name, arguments, deadline)?;
        self.answer(number, name, deadline)
    }

    /// Takes leave of the server.
    pub fn close(self) {
        self.connection.close(std::time::Duration::from_millis(100));
    }

    /// The next message, which is an answer to something.
    fn message(&mut self, name: &str, deadline: &Deadline) -> Result<Value> {
        let what = format!("answered `{name}`");
        let mut reader =
            Reader { connection: &mut self.connection, deadline, what: &what, left: LONGEST, failed: None };
        // An answer is an array of four, the first of which is 1. Whatever else listens at this port begins differently.
        let begins = [reader.byte()?, reader.byte()?] == [0x94, 0x01];
        let mut rest = || rmpv::decode::read_value(&mut reader).ok();
        let parts = begins.then(|| [rest(), rest(), rest()]);
        if let Some(error) = reader.failed.take() {
            return Err(error);
        }
        match parts {
            Some([Some(number), Some(refused), Some(result)]) if number.is_u64() => {
                Ok(array([1.into(), number, refused, result]))
            }
            _ => Err(self.nonsense(format!("answers `{name}` with what is not MessagePack-RPC"))),
        }
    }

    /// The value within an answer, or the reason why there is none.
    fn unwrapped(&self, name: &str, result: &Value) -> Result<Value> {
        let outcome = element(result, 0);
        let refusal = match (element(outcome, 0), elements(outcome)) {
            (Value::Boolean(false), _) => return Ok(Value::Nil),
            (Value::Integer(kind), [_, value]) if kind.as_u64() == Some(1) => return Ok(value.clone()),
            (Value::Boolean(true), [_, refusal]) => refusal,
            (Value::Integer(_), [_, refusal]) => refusal,
            _ => return Err(self.nonsense(format!("answers `{name}` with what is not an answer of CARLA"))),
        };
        let reason = said(element(refusal, 0));
        Err(Error::new(format!("{} refused `{name}`: {reason}", self.peer())))
    }

    fn nonsense(&self, what: String) -> Error {
        let peer = self.peer();
        Error::of(ErrorKind::Nonsense, format!("{peer} {what}; is another program at this port?"))
    }
}

/// A value as it is quoted in an error.
fn said(value: &Value) -> String {
    let all = match text(value) {
        "" => value.to_string(),
        text => text.to_owned(),
    };
    all.chars().take(300).collect()
}

/// The connection as something that a value can be read from. What goes wrong is kept, since it does not fit through.
struct Reader<'a> {
    connection: &'a mut Connection,
    deadline: &'a Deadline,
    what: &'a str,
    /// This many bytes the message may still have.
    left: usize,
    failed: Option<Error>,
}

impl Reader<'_> {
    fn byte(&mut self) -> Result<u8> {
        let mut byte = [0];
        match self.read_exact(&mut byte) {
            Ok(()) => Ok(byte[0]),
            Err(error) => Err(self.failed.take().unwrap_or_else(|| error.into())),
        }
    }
}

impl Read for Reader<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // A long value is asked for piece by piece, so that it takes no more memory than there are bytes of it.
        let length = buffer.len().min(1 << 16);
        let read = match self.left.checked_sub(length) {
            Some(left) => {
                self.left = left;
                self.connection.bytes(length, self.deadline, self.what)
            }
            None => Err(Error::of(
                ErrorKind::Nonsense,
                format!(
                    "{} sends an answer of more than {LONGEST} bytes, which is none of CARLA's; is another program at this port?",
                    self.connection.peer()
                ),
            )),
        };
        match read {
            Ok(bytes) => {
                buffer[..length].copy_from_slice(bytes);
                Ok(length)
            }
            Err(error) => {
                self.failed = Some(error);
                Err(io::ErrorKind::Other.into())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::net::{TcpListener, TcpStream};
    use std::time::Duration;

    use super::*;

    /// A server that has said this, and what comes of a request.
    fn answered(said: &[u8]) -> Result<Value> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (mut server, _) = listener.accept().unwrap();
        server.write_all(said).unwrap();
        let mut rpc = Rpc::new(Connection::new(stream, "CARLA", LONGEST).unwrap());
        rpc.call("tick_cue", Vec::new(), &Deadline::new(Duration::from_millis(300), "answer_seconds"))
    }

    fn message(parts: [Value; 3]) -> Vec<u8> {
        let [number, refused, result] = parts;
        let mut bytes = Vec::new();
        rmpv::encode::write_value(&mut bytes, &array([1.into(), number, refused, result])).unwrap();
        bytes
    }

    fn good(number: u32, value: Value) -> Vec<u8> {
        message([number.into(), Value::Nil, array([array([1.into(), value])])])
    }

    #[test]
    fn answers_differ_from_refusals_and_from_those_of_others() {
        assert_eq!(answered(&good(0, 75.into())), Ok(75.into()));
        // An answer that is not waited for comes first.
        assert_eq!(answered(&[good(9, 1.into()), good(0, 75.into())].concat()), Ok(75.into()));
        let done = array([array([Value::Boolean(false)])]);
        assert_eq!(answered(&message([0.into(), Value::Nil, done])), Ok(Value::Nil));

        let why = || array(["Spawn failed".into()]);
        for refusal in [array([0.into(), why()]), array([Value::Boolean(true), why()])] {
            let error = answered(&message([0.into(), Value::Nil, array([refusal])])).unwrap_err();
            assert_eq!(error.message(), "CARLA refused `tick_cue`: Spawn failed");
        }
        let error = answered(&message([0.into(), "unknown function".into(), Value::Nil])).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Configuration);
        assert!(error.message().contains("unknown function"), "{error}");
    }

    #[test]
    fn a_wrong_answer_is_nonsense_and_half_of_one_is_late() {
        let text = b"HTTP/1.1 400 Bad Request\r\n\r\n".to_vec();
        let strange = message([0.into(), Value::Nil, 3.into()]);
        for said in [text, vec![0xff; 50], vec![0x94, 0x01, 0xc1, 0xc1, 0xc1], strange] {
            let error = answered(&said).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Nonsense, "{error}");
            assert!(error.message().ends_with("is another program at this port?"), "{error}");
        }
        let half = &good(0, "a longer answer".into())[..12];
        assert_eq!(answered(half).unwrap_err().kind(), ErrorKind::Late);
        assert_eq!(answered(&[]).unwrap_err().kind(), ErrorKind::Late);
    }

    #[test]
    fn an_answer_without_end_is_not_kept() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let (mut server, _) = listener.accept().unwrap();
        let flood = std::thread::spawn(move || {
            // A binary value of 100 MB.
            let mut begin = vec![0x94, 0x01, 0x00, 0xc0, 0xc6];
            begin.extend(100_000_000u32.to_be_bytes());
            let _ = server.write_all(&begin);
            while server.write_all(&[0; 100_000]).is_ok() {}
        });
        let mut rpc = Rpc::new(Connection::new(stream, "CARLA", LONGEST).unwrap());
        let deadline = Deadline::new(Duration::from_secs(20), "answer_seconds");
        let error = rpc.call("version", Vec::new(), &deadline).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Nonsense);
        assert!(error.message().contains(&format!("more than {LONGEST} bytes")), "{error}");
        drop(rpc);
        flood.join().unwrap();
    }
}
