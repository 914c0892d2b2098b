//! The emulator's machine protocol (QMP): access to the machine without the core.

use crate::socket::{Socket, SocketError};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Duration;

/// A connection to the machine protocol.
#[derive(Debug)]
pub struct Qmp {
    socket: Socket,
}

impl Qmp {
    /// Connects to the emulator at the local socket `path`. `limit` is the time limit of the
    /// connection and of each later request.
    ///
    /// # Errors
    /// If the emulator does not answer in time.
    pub fn connect(path: &Path, limit: Duration) -> Result<Self, SocketError> {
        let socket = Socket::connect(path, limit)?;
        let mut qmp = Self { socket };
        let greeting = qmp.receive()?;
        if greeting.get("QMP").is_none() {
            return Err(SocketError::NotUnderstood(greeting.to_string()));
        }
        qmp.execute("qmp_capabilities", json!({}))?;
        Ok(qmp)
    }

    /// Executes a command of the protocol and returns its result.
    ///
    /// # Errors
    /// If the emulator rejects it or does not answer.
    pub fn execute(&mut self, command: &str, arguments: Value) -> Result<Value, SocketError> {
        let request = json!({"execute": command, "arguments": arguments}).to_string();
        self.socket.write(request.as_bytes())?;
        loop {
            let mut answer = self.receive()?;
            if let Some(result) = answer.get_mut("return") {
                return Ok(result.take());
            }
            if let Some(error) = answer.get("error") {
                let answer = error.to_string();
                return Err(SocketError::Refused { request, answer });
            }
            // Anything else is an event, which is ignored.
        }
    }

    /// Executes a line of the emulator's monitor and returns its output.
    ///
    /// # Errors
    /// If the emulator does not answer.
    pub(crate) fn monitor(&mut self, line: &str) -> Result<String, SocketError> {
        let printed = self.execute("human-monitor-command", json!({"command-line": line}))?;
        let text = printed.as_str().map(str::to_owned);
        text.ok_or_else(|| SocketError::NotUnderstood(printed.to_string()))
    }

    /// Reads the 32-bit word at a physical address, of memory or of a device's registers.
    ///
    /// # Errors
    /// If nothing is mapped there, or the emulator does not answer.
    pub fn read_word(&mut self, address: u32) -> Result<u32, SocketError> {
        let line = format!("xp /1xw {address:#x}");
        let printed = self.monitor(&line)?;
        // For example `0000000040000434: 0x000004e2`.
        let word = printed.trim().rsplit_once(": 0x").map(|(_, digits)| digits);
        let word = word.and_then(|digits| u32::from_str_radix(digits, 16).ok());
        word.ok_or(SocketError::Refused {
            request: line,
            answer: printed,
        })
    }

    fn receive(&mut self) -> Result<Value, SocketError> {
        let line = self.socket.read_line()?;
        serde_json::from_str(&line).map_err(|_| SocketError::NotUnderstood(line))
    }
}
