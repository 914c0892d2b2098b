//! The emulator's gdb stub: stops, reads and changes the core over the remote serial protocol.
//!
//! QEMU treats a stopped core as idle (observed in 7.2), and idle time is skipped: at each stop the
//! virtual time advances to the next timer interrupt, which is then due immediately. Data are
//! unchanged, but a run with many stops has less time between its interrupts. A stop while the core
//! would be idle has no effect. Protocol: the GDB manual, appendix "GDB Remote Serial Protocol".

use crate::socket::{LONGEST_LINE, Socket, SocketError};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

/// Disables interrupts and timers in single steps. Otherwise a step past a breakpoint enters the
/// interrupt that the stop has made due, and the core returns to the breakpoint without having
/// passed it.
const STEP_ALONE: &str = "Qqemu.sstep=7";
/// Size of a Thumb breakpoint in the protocol, bytes.
const THUMB_BREAKPOINT: u32 = 2;

/// Reason why the core has stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// At a breakpoint.
    Breakpoint,
    /// The program and the emulator have ended with this exit code, of which the protocol contains
    /// the low 8 bits.
    Exited(u8),
}

/// A core register of a Cortex-M.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Register {
    /// R0 to R12.
    R(u8),
    /// Stack pointer.
    Sp,
    /// Link register.
    Lr,
    /// Program counter.
    Pc,
    /// Program status.
    Xpsr,
}

impl Register {
    /// Its number in the protocol. The status follows eight registers of an older floating-point
    /// unit.
    fn number(self) -> u8 {
        match self {
            Self::R(index) => index,
            Self::Sp => 13,
            Self::Lr => 14,
            Self::Pc => 15,
            Self::Xpsr => 25,
        }
    }
}

/// A connection to the gdb stub.
#[derive(Debug)]
pub struct Gdb {
    socket: Socket,
    breakpoints: BTreeSet<u32>,
}

impl Gdb {
    /// Connects to the stub at the local socket `path` and stops the core. `limit` is the time
    /// limit of the connection and of each later request.
    ///
    /// # Errors
    /// If the stub does not answer in time.
    pub fn connect(path: &Path, limit: Duration) -> Result<Self, SocketError> {
        let socket = Socket::connect(path, limit)?;
        let mut gdb = Self {
            socket,
            breakpoints: BTreeSet::new(),
        };
        // The emulator allows access to single registers only after a request for their
        // description.
        let description = gdb.request("qXfer:features:read:target.xml:0,fff")?;
        if !description.starts_with(['l', 'm']) {
            return Err(SocketError::NotUnderstood(description));
        }
        gdb.acknowledged(STEP_ALONE)?;
        Ok(gdb)
    }

    /// Stops the core whenever it is about to execute the instruction at `address`.
    ///
    /// # Errors
    /// If the stub rejects the request or does not answer.
    pub fn set_breakpoint(&mut self, address: u32) -> Result<(), SocketError> {
        self.acknowledged(&format!("Z1,{address:x},{THUMB_BREAKPOINT}"))?;
        self.breakpoints.insert(address);
        Ok(())
    }

    /// Removes a breakpoint.
    ///
    /// # Errors
    /// If the stub rejects the request or does not answer.
    pub fn remove_breakpoint(&mut self, address: u32) -> Result<(), SocketError> {
        self.acknowledged(&format!("z1,{address:x},{THUMB_BREAKPOINT}"))?;
        self.breakpoints.remove(&address);
        Ok(())
    }

    /// Runs the core until it stops, for at most `limit` of the host's time.
    ///
    /// # Errors
    /// If it does not stop in time. It then continues until the emulator is dropped.
    pub fn run_to_stop(&mut self, limit: Duration) -> Result<Stop, SocketError> {
        let here = self.read_register(Register::Pc)?;
        // A breakpoint at this address would stop the core again immediately.
        if self.breakpoints.contains(&here) {
            self.remove_breakpoint(here)?;
            let stop = self.go("s", limit)?;
            if stop != Stop::Breakpoint {
                return Ok(stop);
            }
            self.set_breakpoint(here)?;
        }
        self.go("c", limit)
    }

    /// Stops the core after each write to the word at `address`.
    ///
    /// After a breakpoint the emulator translates the whole program again; after this it does not.
    ///
    /// # Errors
    /// If the stub rejects the request or does not answer.
    pub(crate) fn watch(&mut self, address: u32) -> Result<(), SocketError> {
        self.acknowledged(&format!("Z2,{address:x},4"))
    }

    /// Removes what [`watch`](Self::watch) has set.
    ///
    /// # Errors
    /// If the stub rejects the request or does not answer.
    pub(crate) fn unwatch(&mut self, address: u32) -> Result<(), SocketError> {
        self.acknowledged(&format!("z2,{address:x},4"))
    }

    /// As [`run_to_stop`](Self::run_to_stop), for a core that is at no breakpoint.
    ///
    /// # Errors
    /// As [`run_to_stop`](Self::run_to_stop).
    pub(crate) fn go_on(&mut self, limit: Duration) -> Result<Stop, SocketError> {
        self.go("c", limit)
    }

    fn go(&mut self, how: &str, limit: Duration) -> Result<Stop, SocketError> {
        self.send(how)?;
        self.wait_for_stop(limit)
    }

    /// Runs the core for `duration` of the host's time, or to a stop before that; stops it then and
    /// waits for that at most `limit`.
    pub(crate) fn run_for(
        &mut self,
        duration: Duration,
        limit: Duration,
    ) -> Result<Stop, SocketError> {
        /// The protocol's request to stop, which is no packet.
        const INTERRUPT: u8 = 3;
        self.send("c")?;
        std::thread::sleep(duration);
        self.socket.write(&[INTERRUPT])?;
        self.wait_for_stop(limit)
    }

    /// Waits at most `limit` for the report of a stop.
    fn wait_for_stop(&mut self, limit: Duration) -> Result<Stop, SocketError> {
        let usual = self.socket.limit();
        self.socket.wait_at_most(limit)?;
        let answer = self.receive()?;
        self.socket.wait_at_most(usual)?;
        let code = answer
            .get(1..3)
            .and_then(|c| u8::from_str_radix(c, 16).ok());
        match (answer.as_bytes().first(), code) {
            (Some(b'T' | b'S'), Some(_)) => Ok(Stop::Breakpoint),
            (Some(b'W'), Some(code)) => Ok(Stop::Exited(code)),
            _ => Err(SocketError::NotUnderstood(answer)),
        }
    }

    /// Reads `length` bytes of memory or of a device's registers, as the core reads them.
    ///
    /// # Errors
    /// If nothing is mapped there, or the stub does not answer.
    pub fn read_memory(&mut self, address: u32, length: usize) -> Result<Vec<u8>, SocketError> {
        let request = format!("m{address:x},{length:x}");
        let answer = self.request(&request)?;
        let bytes = from_hex(&answer).ok_or_else(|| refused(&request, &answer))?;
        if bytes.len() == length {
            Ok(bytes)
        } else {
            Err(refused(&request, &answer))
        }
    }

    /// Writes memory, including flash. The emulator ignores writes to a device's registers.
    ///
    /// # Errors
    /// If nothing is mapped there, or the stub does not answer.
    pub fn write_memory(&mut self, address: u32, bytes: &[u8]) -> Result<(), SocketError> {
        self.acknowledged(&format!("M{address:x},{:x}:{}", bytes.len(), to_hex(bytes)))
    }

    /// Reads a core register.
    ///
    /// # Errors
    /// If there is no such register, or the stub does not answer.
    pub fn read_register(&mut self, register: Register) -> Result<u32, SocketError> {
        let request = format!("p{:x}", register.number());
        let answer = self.request(&request)?;
        let bytes = from_hex(&answer).and_then(|bytes| bytes.try_into().ok());
        let bytes = bytes.ok_or_else(|| refused(&request, &answer))?;
        Ok(u32::from_le_bytes(bytes))
    }

    /// Writes a core register.
    ///
    /// # Errors
    /// If there is no such register, or the stub does not answer.
    pub fn write_register(&mut self, register: Register, value: u32) -> Result<(), SocketError> {
        let value = to_hex(&value.to_le_bytes());
        self.acknowledged(&format!("P{:x}={value}", register.number()))
    }

    /// Removes all breakpoints, resumes the core and detaches.
    ///
    /// # Errors
    /// If the stub rejects the request or does not answer.
    pub fn detach(mut self) -> Result<(), SocketError> {
        match self.acknowledged("D") {
            // The core continues before the stub answers, so a program that ends closes the
            // connection.
            Err(SocketError::Lost(_)) => Ok(()),
            other => other,
        }
    }

    fn acknowledged(&mut self, request: &str) -> Result<(), SocketError> {
        match self.request(request)?.as_str() {
            "OK" => Ok(()),
            answer => Err(refused(request, answer)),
        }
    }

    fn request(&mut self, request: &str) -> Result<String, SocketError> {
        self.send(request)?;
        self.receive()
    }

    /// Sends a packet and waits for its acknowledgement.
    fn send(&mut self, content: &str) -> Result<(), SocketError> {
        let packet = format!("${content}#{:02x}", checksum(content.as_bytes()));
        self.socket.write(packet.as_bytes())?;
        match self.socket.read_byte()? {
            b'+' => Ok(()),
            other => Err(SocketError::NotUnderstood(char::from(other).into())),
        }
    }

    /// Receives a packet and acknowledges it.
    fn receive(&mut self) -> Result<String, SocketError> {
        let mut content = Vec::new();
        let mut is_inside = false;
        let mut left = LONGEST_LINE;
        loop {
            match self.socket.read_byte()? {
                b'$' if !is_inside => is_inside = true,
                b'#' if is_inside => break,
                byte if is_inside => content.push(byte),
                _ => {}
            }
            left -= 1;
            if left == 0 {
                return Err(SocketError::NotUnderstood("a packet without end".into()));
            }
        }
        let digits = [self.socket.read_byte()?, self.socket.read_byte()?];
        let text = String::from_utf8_lossy(&content).into_owned();
        if from_hex(&String::from_utf8_lossy(&digits)) != Some(vec![checksum(&content)]) {
            return Err(SocketError::NotUnderstood(text));
        }
        match self.socket.write(b"+") {
            // The stub closes the connection after the report of the program's end; if it has done so for
            // another reason, the next request fails.
            Ok(()) | Err(SocketError::Lost(_)) => Ok(text),
            Err(error) => Err(error),
        }
    }
}

fn refused(request: &str, answer: &str) -> SocketError {
    SocketError::Refused {
        request: request.into(),
        answer: answer.into(),
    }
}

fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn from_hex(text: &str) -> Option<Vec<u8>> {
    if !text.len().is_multiple_of(2) {
        return None;
    }
    let pairs = (0..text.len()).step_by(2).map(|i| text.get(i..i + 2));
    pairs
        .map(|pair| u8::from_str_radix(pair?, 16).ok())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hexadecimal_both_ways() {
        assert_eq!(to_hex(&[0, 0x1f, 0xff]), "001fff");
        assert_eq!(from_hex("001fff"), Some(vec![0, 0x1f, 0xff]));
        for bad in ["0", "0g", "E1x", "é"] {
            assert_eq!(from_hex(bad), None, "{bad}");
        }
    }

    #[test]
    fn checksum_is_the_sum_modulo_256() {
        // The manual's own example of a packet: $m4015bc,2#5a.
        assert_eq!(checksum(b"m4015bc,2"), 0x5a);
    }
}
