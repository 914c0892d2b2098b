//! Manipulation of the firmware through the emulator's gdb stub and QMP: breakpoints, registers,
//! memory.

use super::addresses::Addresses;
use crate::fault::processor_fault::Action;
use qemu::SocketError;
use qemu::gdb::{Gdb, Register, Stop};
use qemu::qmp::Qmp;
use std::path::Path;
use std::time::Duration;

/// `b .` as Thumb code.
const HANG: [u8; 2] = [0xFE, 0xE7];
/// Bytes of stack left for an interrupt that is to overflow it.
const STACK_LEFT: u32 = 16;
/// An address without code.
const INVALID_ADDRESS: u32 = 0xF000_0000;
/// Consecutive PWM interrupts that delay a control task: more than those of one control tick.
const HELD_INTERRUPTS: u32 = 14;
/// Instructions of the control interrupt at which a breakpoint is set.
const TRIED_INSTRUCTIONS: u32 = 6;

/// Manipulates the processor.
pub struct Debugger<'a> {
    /// Socket of the gdb stub.
    pub gdb: &'a Path,
    /// Socket of QMP.
    pub qmp: &'a Path,
    pub addresses: Addresses,
    /// Longest time to wait for an answer.
    pub time_out: Duration,
}

impl Debugger<'_> {
    /// Performs an action at a control tick, from 1.
    pub(crate) fn act(&self, action: Action, tick: u32) -> Result<(), SocketError> {
        let mut gdb = Gdb::connect(self.gdb, self.time_out)?;
        let mut qmp = Qmp::connect(self.qmp, self.time_out)?;
        self.run_to_tick(&mut gdb, tick)?;
        let addresses = &self.addresses;
        match action {
            Action::Nothing => {}
            Action::Flip { address, bit } => flip(&mut gdb, address, bit)?,
            Action::FlipStack { seed, offset, bit } => {
                self.run_into_control_interrupt(&mut gdb, seed)?;
                let sp = gdb.read_register(Register::Sp)?;
                flip(&mut gdb, (sp + offset).min(addresses.stack_start - 1), bit)?;
            }
            Action::MissPwm(count) => {
                for _ in 0..count {
                    self.run_to_pwm_interrupt(&mut gdb)?;
                    gdb.write_register(Register::Pc, addresses.return_code)?;
                }
            }
            Action::DoublePwm => {
                self.run_to_pwm_interrupt(&mut gdb)?;
                self.call_twice(&mut gdb, addresses.pwm_interrupt)?;
            }
            Action::MissControl => gdb.write_register(Register::Pc, addresses.return_code)?,
            Action::DoubleControl => self.call_twice(&mut gdb, addresses.control_interrupt)?,
            Action::Overrun => {
                for _ in 0..HELD_INTERRUPTS {
                    self.run_to_pwm_interrupt(&mut gdb)?;
                }
            }
            Action::HangMainLoop => gdb.write_memory(addresses.idle, &HANG)?,
            Action::OverflowStack => {
                self.run_to_pwm_interrupt(&mut gdb)?;
                gdb.write_register(Register::Sp, addresses.stack_end + STACK_LEFT)?;
            }
            Action::HardFault => {
                self.run_to_pwm_interrupt(&mut gdb)?;
                gdb.write_register(Register::Pc, INVALID_ADDRESS)?;
            }
            Action::Reset => {
                qmp.execute("system_reset", serde_json::json!({}))?;
            }
        }
        gdb.detach()
    }

    /// Runs to the first instruction of the control interrupt of that tick.
    fn run_to_tick(&self, gdb: &mut Gdb, tick: u32) -> Result<(), SocketError> {
        let interrupt = self.addresses.control_interrupt;
        gdb.set_breakpoint(interrupt)?;
        // Each interrupt before that of the tick stops here at least once.
        for _ in 1..tick {
            self.run_to_stop(gdb)?;
        }
        // One that is preempted at its first instruction stops there twice, so stops cannot be counted.
        while self.finished_ticks(gdb)? + 1 < tick || gdb.read_register(Register::Pc)? != interrupt
        {
            self.run_to_stop(gdb)?;
        }
        gdb.remove_breakpoint(interrupt)
    }

    /// Runs to the first instruction of the next PWM interrupt.
    fn run_to_pwm_interrupt(&self, gdb: &mut Gdb) -> Result<(), SocketError> {
        gdb.set_breakpoint(self.addresses.pwm_interrupt)?;
        self.run_to_stop(gdb)?;
        gdb.remove_breakpoint(self.addresses.pwm_interrupt)
    }

    /// From the start of the control interrupt, runs to one of its instructions: the first that is
    /// reached of several that `seed` selects. If none is reached, it runs to the main loop.
    fn run_into_control_interrupt(&self, gdb: &mut Gdb, seed: u32) -> Result<(), SocketError> {
        let Addresses {
            control_interrupt,
            control_bytes,
            idle,
            ..
        } = self.addresses;
        let mut stops: Vec<u32> = (1..=TRIED_INSTRUCTIONS)
            .map(|k| control_interrupt + ((seed.wrapping_mul(k) % control_bytes) & !1))
            .collect();
        stops.push(idle);
        stops.sort_unstable();
        stops.dedup();
        for stop in &stops {
            gdb.set_breakpoint(*stop)?;
        }
        self.run_to_stop(gdb)?;
        for stop in stops {
            gdb.remove_breakpoint(stop)?;
        }
        Ok(())
    }

    /// At the first instruction of an interrupt: runs it twice.
    fn call_twice(&self, gdb: &mut Gdb, interrupt: u32) -> Result<(), SocketError> {
        let back = gdb.read_register(Register::Lr)?;
        let stack = gdb.read_register(Register::Sp)?;
        gdb.write_register(Register::Lr, interrupt | 1)?;
        gdb.set_breakpoint(interrupt)?;
        loop {
            self.run_to_stop(gdb)?;
            // Neither a call by another interrupt, nor the stop before its first instruction.
            let is_second = gdb.read_register(Register::Lr)? != interrupt | 1;
            if is_second && gdb.read_register(Register::Sp)? == stack {
                break;
            }
        }
        gdb.remove_breakpoint(interrupt)?;
        gdb.write_register(Register::Lr, back)
    }

    fn run_to_stop(&self, gdb: &mut Gdb) -> Result<(), SocketError> {
        match gdb.run_to_stop(self.time_out)? {
            Stop::Breakpoint => Ok(()),
            Stop::Exited(code) => Err(SocketError::NotUnderstood(format!("exit with {code}"))),
        }
    }

    fn finished_ticks(&self, gdb: &mut Gdb) -> Result<u32, SocketError> {
        let bytes = gdb.read_memory(self.addresses.control_ticks, 4)?;
        let bytes = bytes
            .try_into()
            .expect("the answer has the requested length");
        Ok(u32::from_le_bytes(bytes))
    }
}

fn flip(gdb: &mut Gdb, address: u32, bit: u8) -> Result<(), SocketError> {
    let mut byte = gdb.read_memory(address, 1)?;
    byte[0] ^= 1 << bit;
    gdb.write_memory(address, &byte)
}
