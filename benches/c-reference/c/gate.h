/* Faults that the gate detects, as in shared-model/src/gate/fault.rs: the number is the bit. */
#ifndef GATE_H
#define GATE_H

#include <stdint.h>

enum fault {
    FAULT_SENSOR_NOT_A_NUMBER,
    FAULT_SENSOR_RANGE,
    FAULT_SENSOR_RATE,
    FAULT_SENSOR_STUCK,
    FAULT_STEERING_INCONSISTENT,
    FAULT_LATERAL_ACCELERATION,
    FAULT_FRAME_AGE,
    FAULT_TICK_WINDOW,
    FAULT_CONTROL_LATE,
    FAULT_COMMAND_NOT_A_NUMBER,
    FAULT_MOTOR_VOLTAGE,
    FAULT_MOTOR_SLEW,
    FAULT_DITHER_AMPLITUDE,
    FAULT_DITHER_FREQUENCY,
    FAULT_READBACK,
    FAULT_CHANNELS_DIFFER,
    FAULT_FRAMES_INVALID,
    FAULT_DITHER_WEAK,
    FAULT_FEEDBACK_VOLTAGE,
    FAULT_FEEDBACK_SLEW,
    FAULT_DITHER_COMMAND,
};

static inline uint32_t fault_if(int found, enum fault fault)
{
    return found ? 1u << fault : 0u;
}

#endif
