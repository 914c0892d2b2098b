//! The signals on the ECU's pins in one PWM period, as fixed-length packets: a host takes the place
//! of servo and sensors.
//!
//! At the start of each period the ECU puts out its duty, and at a control tick an actuator frame.
//! The host moves the vehicle through that period and answers with the duty that was seen on the
//! servo's pin and, at a control tick, a sensor frame. The frames themselves are opaque here; the
//! module `frame` reads them.

/// Length of a sensor or actuator frame, bytes: a CAN FD payload.
pub const FRAME_LEN: usize = 24;
/// Bytes of a sensor or actuator frame.
pub type FrameBytes = [u8; FRAME_LEN];
/// Length of either packet, bytes: duty code, "the bridge is on", "a frame follows", frame (zeros
/// without one).
pub const PACKET_LEN: usize = 2 + 1 + 1 + FRAME_LEN;
/// Bytes of a packet.
pub type PacketBytes = [u8; PACKET_LEN];

/// Length of the ECU's message, bytes: packet, cost of the PWM task, cost of the control task.
pub const TO_HOST_LEN: usize = PACKET_LEN + 2 + 2;
/// Length of the message to the ECU, bytes: packet, "the run is over".
pub const TO_ECU_LEN: usize = PACKET_LEN + 1;

/// One direction of the exchange in one PWM period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// From the ECU: the duty code of the period that begins. To the ECU: the code that was
    /// captured at the servo's pin during that period.
    pub duty_code: u16,
    /// From the ECU: whether the servo's bridge is on in the period that begins; without it no
    /// voltage is applied, whatever the duty. To the ECU: as it was in that period.
    pub bridge_on: bool,
    /// From the ECU an actuator frame, to the ECU a sensor frame; `None` between control ticks, or
    /// if it was lost.
    pub frame: Option<FrameBytes>,
}

impl Packet {
    /// The packet's bytes.
    ///
    /// ```
    /// use shared_model::exchange::Packet;
    /// let packet = Packet { duty_code: 1250, bridge_on: true, frame: Some([7; 24]) };
    /// assert_eq!(Packet::decode(&packet.encode()), packet);
    /// ```
    pub fn encode(&self) -> PacketBytes {
        let mut bytes = [0; PACKET_LEN];
        bytes[..2].copy_from_slice(&self.duty_code.to_le_bytes());
        bytes[2] = self.bridge_on.into();
        if let Some(frame) = &self.frame {
            bytes[3] = 1;
            bytes[4..].copy_from_slice(frame);
        }
        bytes
    }

    /// Reads a packet's bytes.
    pub fn decode(bytes: &PacketBytes) -> Self {
        let mut frame = [0; FRAME_LEN];
        frame.copy_from_slice(&bytes[4..]);
        Self {
            duty_code: u16::from_le_bytes([bytes[0], bytes[1]]),
            bridge_on: bytes[2] != 0,
            frame: (bytes[3] != 0).then_some(frame),
        }
    }
}

/// The ECU's message in a PWM period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ToHost {
    /// Duty, bridge and actuator frame.
    pub packet: Packet,
    /// Most counts of the cost clock that the PWM task took in a period since the last control
    /// tick, without the exchange.
    pub pwm_cost: u16,
    /// Counts of the cost clock that the last control task took.
    pub control_cost: u16,
}

impl ToHost {
    /// Its bytes.
    pub fn encode(&self) -> [u8; TO_HOST_LEN] {
        let mut bytes = [0; TO_HOST_LEN];
        bytes[..PACKET_LEN].copy_from_slice(&self.packet.encode());
        let [a, b] = self.pwm_cost.to_le_bytes();
        let [c, d] = self.control_cost.to_le_bytes();
        bytes[PACKET_LEN..].copy_from_slice(&[a, b, c, d]);
        bytes
    }

    /// Reads its bytes.
    pub fn decode(bytes: &[u8; TO_HOST_LEN]) -> Self {
        let mut packet = [0; PACKET_LEN];
        packet.copy_from_slice(&bytes[..PACKET_LEN]);
        let number = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        Self {
            packet: Packet::decode(&packet),
            pwm_cost: number(PACKET_LEN),
            control_cost: number(PACKET_LEN + 2),
        }
    }
}

/// The message to the ECU in a PWM period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ToEcu {
    /// Captured duty and sensor frame.
    pub packet: Packet,
    /// The run is over.
    pub stop: bool,
}

impl ToEcu {
    /// Its bytes.
    pub fn encode(&self) -> [u8; TO_ECU_LEN] {
        let mut bytes = [0; TO_ECU_LEN];
        bytes[..PACKET_LEN].copy_from_slice(&self.packet.encode());
        bytes[PACKET_LEN] = self.stop.into();
        bytes
    }

    /// Reads its bytes.
    pub fn decode(bytes: &[u8; TO_ECU_LEN]) -> Self {
        let mut packet = [0; PACKET_LEN];
        packet.copy_from_slice(&bytes[..PACKET_LEN]);
        Self {
            packet: Packet::decode(&packet),
            stop: bytes[PACKET_LEN] != 0,
        }
    }
}
