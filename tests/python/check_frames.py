"""Answers questions about frames with autosar-e2e and cantools, which share no code with this project.

The DBC files, for CAN FD and for classic CAN, are named on the command line. Each line on standard input gets one line in answer:

MESSAGE      what the DBC file says of the message: key=value ...
MESSAGE HEX  the bytes protected anew, the verdict of the check on the bytes as they are, then signal=value ... of a whole frame
classic MESSAGE HEX  signal=value ... of the three frames on classic CAN
"""

import sys

import cantools
from e2e import p05


def attribute(message, name):
    return message.dbc.attributes[name].value


STATE_MACHINE = [
    "E2ESMWindowSize",
    "E2ESMMinOkStateInit",
    "E2ESMMaxErrorStateInit",
    "E2ESMMinOkStateValid",
    "E2ESMMaxErrorStateValid",
    "E2ESMMinOkStateInvalid",
    "E2ESMMaxErrorStateInvalid",
]


def state_machine(message):
    numbers = [attribute(message, name) for name in STATE_MACHINE if name in message.dbc.attributes]
    return ",".join(map(str, numbers)) if numbers else "none"


def description(message):
    return {
        "can_fd": message.is_fd,
        "length": message.length,
        "profile": attribute(message, "E2EProfile"),
        "data_id": attribute(message, "E2EDataId"),
        "max_delta_counter": attribute(message, "E2EMaxDeltaCounter"),
        "state_machine": state_machine(message),
    }


def protected(data, data_id):
    # Without the checksum that is asked for, and one behind: the package counts up before it protects.
    anew = bytearray(data)
    anew[0:2] = bytes(2)
    anew[2] = (anew[2] - 1) % 256
    p05.e2e_p05_protect(anew, data_id)
    return anew.hex()


def pairs(values):
    return [f"{name}={value}" for name, value in values.items()]


def answer(message, data=None):
    if data is None:
        return pairs(description(message))
    data = bytes.fromhex(data)
    data_id = attribute(message, "E2EDataId")
    verdict = "whole" if p05.e2e_p05_check(data, data_id) else "error"
    # The signals of a damaged frame mean nothing, and may have no kind of message to them.
    signals = pairs(message.decode(data)) if verdict == "whole" else []
    return [protected(data, data_id), verdict, *signals]


def classic_answer(name, data):
    data = bytes.fromhex(data)
    segments = [data[start : start + 8] for start in range(0, len(data), 8)]
    messages = [classic.get_message_by_name(f"{name}{number}") for number in (1, 2, 3)]
    return [pair for message, segment in zip(messages, segments) for pair in pairs(message.decode(segment))]


database = cantools.database.load_file(sys.argv[1])
classic = cantools.database.load_file(sys.argv[2])
# All questions first: who asks may not read before everything is written.
for line in sys.stdin.read().splitlines():
    name, *data = line.split()
    if name == "classic":
        print(*classic_answer(*data))
    else:
        print(*answer(database.get_message_by_name(name), *data))
