//! Effect of a Thumb-2 instruction on the stack and on the control flow. Other effects are ignored.
//!
//! Encodings after the ARMv7-M Architecture Reference Manual (Arm DDI 0403), chapter A7.

/// Number of the stack pointer.
const SP: u32 = 13;
/// Number of the link register.
const LR: u32 = 14;
/// Number of the program counter.
const PC: u32 = 15;

/// Effect of an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// No relevant effect; includes returns, and table branches within the function.
    None,
    /// Pushes this number of bytes.
    Push(u32),
    /// Sets the stack pointer to a value that the instruction does not contain.
    SetStackPointer,
    /// Calls the function at the address.
    Call(u32),
    /// Branches to the address.
    Branch(u32),
    /// Calls or branches to a function whose address is in a register or in memory.
    Indirect,
    /// Stops for a debugger; without one it is a fault. Semihosting calls are of this kind.
    Breakpoint,
    /// Loads a constant into the lower half of a register and clears the upper half.
    LowHalf(u32, u32),
    /// Loads a constant into the upper half of a register.
    HighHalf(u32, u32),
}

/// Decodes the instruction at `address`, whose first half-words are `first` and `second`: its
/// length, bytes, and its effect.
pub fn decode(address: u32, first: u16, second: u16) -> (u32, Effect) {
    let first = u32::from(first);
    // 0b11101, 0b11110 and 0b11111 begin an instruction of two half-words.
    if first >= 0xE800 {
        (4, wide(address, first, second.into()))
    } else {
        (2, narrow(address, first))
    }
}

fn narrow(address: u32, code: u32) -> Effect {
    match code {
        // PUSH {registers, lr}
        _ if code & 0xFE00 == 0xB400 => Effect::Push(4 * (code & 0x1FF).count_ones()),
        // SUB sp, sp, #immediate
        _ if code & 0xFF80 == 0xB080 => Effect::Push(4 * (code & 0x7F)),
        // BLX register
        _ if code & 0xFF80 == 0x4780 => Effect::Indirect,
        // BX register; BX lr returns
        _ if code & 0xFF80 == 0x4700 => through((code >> 3) & 0xF),
        // MOV register, register
        _ if code & 0xFF00 == 0x4600 => written((code >> 4) & 8 | code & 7, (code >> 3) & 0xF),
        // ADD register, register
        _ if code & 0xFF00 == 0x4400 => written((code >> 4) & 8 | code & 7, PC),
        // CBZ, CBNZ
        _ if code & 0xF500 == 0xB100 => branch(address, (code >> 3) & 0x40 | (code >> 2) & 0x3E, 7),
        // B<condition>; the conditions 14 and 15 are UDF and SVC
        _ if code & 0xF000 == 0xD000 && code & 0x0E00 != 0x0E00 => {
            branch(address, sign_extend(code << 1, 9), 32)
        }
        // BKPT
        _ if code & 0xFF00 == 0xBE00 => Effect::Breakpoint,
        // B
        _ if code & 0xF800 == 0xE000 => branch(address, sign_extend(code << 1, 12), 32),
        _ => Effect::None,
    }
}

fn wide(address: u32, first: u32, second: u32) -> Effect {
    let target = (second >> 8) & 0xF;
    match (first, second) {
        // BL
        _ if first & 0xF800 == 0xF000 && second & 0xD000 == 0xD000 => {
            Effect::Call(far(address, first, second))
        }
        // B.W
        _ if first & 0xF800 == 0xF000 && second & 0xD000 == 0x9000 => {
            Effect::Branch(far(address, first, second))
        }
        // B<condition>.W; with the conditions 14 and 15 it is MSR and other control
        _ if first & 0xF800 == 0xF000 && second & 0xD000 == 0x8000 && first & 0x0380 != 0x0380 => {
            conditional(address, first, second)
        }
        // MSR msp or psp
        _ if first & 0xFFE0 == 0xF380
            && second & 0xFF00 == 0x8800
            && matches!(second & 0xFF, 8 | 9) =>
        {
            Effect::SetStackPointer
        }
        _ if first & 0xF800 == 0xF000 && second & 0x8000 == 0 => immediate(first, second, target),
        // PUSH.W {registers}
        (0xE92D, _) => Effect::Push(4 * second.count_ones()),
        // POP.W {registers}: returns where the program counter is one of them
        (0xE8BD, _) => Effect::None,
        // LDM with the program counter
        _ if first & 0xFE50 == 0xE810 && second & 0x8000 != 0 => Effect::Indirect,
        // STRD, STR, STRH and STRB to [sp, #-immediate]! and [sp], #-immediate
        (0xE96D | 0xE86D, _) => Effect::Push(4 * (second & 0xFF)),
        (0xF84D | 0xF82D | 0xF80D, _) if second & 0x0B00 == 0x0900 => Effect::Push(second & 0xFF),
        // VPUSH
        _ if first & 0xFFBF == 0xED2D && second & 0x0E00 == 0x0A00 => {
            Effect::Push(4 * (second & 0xFF))
        }
        // POP.W {pc} returns; any other LDR to the program counter goes anywhere
        (0xF85D, 0xFB04) => Effect::None,
        _ if first & 0xFF70 == 0xF850 && second >> 12 == PC => Effect::Indirect,
        // Data processing on registers
        _ if first & 0xFE00 == 0xEA00 && target == SP => Effect::SetStackPointer,
        _ => Effect::None,
    }
}

/// Data processing with an immediate.
fn immediate(first: u32, second: u32, target: u32) -> Effect {
    let low = (first & 0x0400) << 1 | (second >> 4) & 0x0700 | second & 0xFF;
    match first & 0xFBF0 {
        0xF240 => return Effect::LowHalf(target, (first & 0xF) << 12 | low),
        0xF2C0 => return Effect::HighHalf(target, (first & 0xF) << 12 | low),
        _ => {}
    }
    if target != SP {
        return Effect::None;
    }
    match first & 0xFBEF {
        // SUB.W and SUBW sp, sp, #immediate
        0xF1AD => Effect::Push(expand(low)),
        0xF2AD => Effect::Push(low),
        // ADD.W and ADDW sp, sp, #immediate
        0xF10D | 0xF20D => Effect::None,
        _ => Effect::SetStackPointer,
    }
}

/// ThumbExpandImm: twelve bits that stand for a constant of thirty-two.
fn expand(code: u32) -> u32 {
    let byte = code & 0xFF;
    match code >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte << 24 | byte << 16 | byte << 8 | byte,
        _ => (0x80 | byte & 0x7F).rotate_right(code >> 7),
    }
}

/// A branch to what a register holds.
fn through(register: u32) -> Effect {
    if register == LR {
        Effect::None
    } else {
        Effect::Indirect
    }
}

/// A register that is written with what another one holds.
fn written(target: u32, source: u32) -> Effect {
    match target {
        SP => Effect::SetStackPointer,
        PC => through(source),
        _ => Effect::None,
    }
}

/// A branch by `offset`, whose lowest `bits` bits count.
fn branch(address: u32, offset: u32, bits: u32) -> Effect {
    let mask = u32::MAX >> (32 - bits);
    Effect::Branch(address.wrapping_add(4).wrapping_add(offset & mask))
}

fn far(address: u32, first: u32, second: u32) -> u32 {
    let sign = (first >> 10) & 1;
    let one = (second >> 13) & 1 ^ sign ^ 1;
    let two = (second >> 11) & 1 ^ sign ^ 1;
    let offset = sign << 24 | one << 23 | two << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
    address
        .wrapping_add(4)
        .wrapping_add(sign_extend(offset, 25))
}

fn conditional(address: u32, first: u32, second: u32) -> Effect {
    let sign = (first >> 10) & 1;
    let (one, two) = ((second >> 13) & 1, (second >> 11) & 1);
    let offset = sign << 20 | two << 19 | one << 18 | (first & 0x3F) << 12 | (second & 0x7FF) << 1;
    branch(address, sign_extend(offset, 21), 32)
}

fn sign_extend(value: u32, bits: u32) -> u32 {
    let unused = 32 - bits;
    (((value << unused) as i32) >> unused) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Address, half-words, length and effect, as `llvm-objdump` disassembles them.
    #[test]
    fn instructions_are_what_a_disassembler_says() {
        let cases = [
            (0x45a, 0xaf00, 0, 2, Effect::None),            // add r7, sp, #0
            (0x458, 0xb580, 0, 2, Effect::Push(8)),         // push {r7, lr}
            (0x492, 0xe92d, 0x0f00, 4, Effect::Push(16)),   // push.w {r8, r9, r10, r11}
            (0x496, 0xb085, 0, 2, Effect::Push(20)),        // sub sp, #20
            (0x500, 0xf5ad, 0x6d80, 4, Effect::Push(1024)), // sub.w sp, sp, #1024
            (0x500, 0xf6ad, 0x7dbc, 4, Effect::Push(4028)), // subw sp, sp, #4028
            (0x500, 0xed2d, 0x8b04, 4, Effect::Push(16)),   // vpush {d8, d9}
            (0x500, 0xf84d, 0xbd04, 4, Effect::Push(4)),    // str r11, [sp, #-4]!
            (0x500, 0xf84d, 0x0c04, 4, Effect::None),       // str r0, [sp, #-4]
            (0x500, 0xe96d, 0x0102, 4, Effect::Push(8)),    // strd r0, r1, [sp, #-8]!
            (0x500, 0xf1a7, 0x0418, 4, Effect::None),       // sub.w r4, r7, #24
            (0x500, 0x46a5, 0, 2, Effect::SetStackPointer), // mov sp, r4
            (0x500, 0xf36f, 0x0d02, 4, Effect::SetStackPointer), // bfc sp, #0, #3
            (0x438, 0xf000, 0xf819, 4, Effect::Call(0x46e)), // bl 0x46e
            (0x472, 0xf7ff, 0xfff1, 4, Effect::Call(0x458)), // bl 0x458
            (0xed62, 0xf000, 0xb804, 4, Effect::Branch(0xed6e)), // b.w 0xed6e
            (0x40c, 0xd001, 0, 2, Effect::Branch(0x412)),   // beq 0x412
            (0x410, 0xe7fb, 0, 2, Effect::Branch(0x40a)),   // b 0x40a
            (0x500, 0xf43f, 0xaf80, 4, Effect::Branch(0x404)), // beq.w 0x404
            (0x500, 0xb110, 0, 2, Effect::Branch(0x508)),   // cbz r0, 0x508
            (0x43c, 0xde00, 0, 2, Effect::None),            // udf #0
            (0x500, 0x4788, 0, 2, Effect::Indirect),        // blx r1
            (0x500, 0x4770, 0, 2, Effect::None),            // bx lr
            (0x500, 0x4718, 0, 2, Effect::Indirect),        // bx r3
            (0x500, 0xe8df, 0xf010, 4, Effect::None),       // tbh [pc, r0, lsl #1]
            (0x500, 0xf85d, 0xfb04, 4, Effect::None),       // ldr pc, [sp], #4
            (0x500, 0xf8d0, 0xf000, 4, Effect::Indirect),   // ldr.w pc, [r0]
            (0x500, 0xf240, 0x4001, 4, Effect::LowHalf(0, 0x401)), // movw r0, #0x401
            (0x500, 0xf2c2, 0x0001, 4, Effect::HighHalf(0, 0x2001)), // movt r0, #0x2001
        ];
        for (address, first, second, length, effect) in cases {
            let decoded = decode(address, first, second);
            assert_eq!(decoded, (length, effect), "{first:04x} {second:04x}");
        }
    }
}
