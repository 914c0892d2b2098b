"""Reads a bus log with python-can, and prints each frame as cantools and autosar-e2e see it.

The DBC file and the log are named on the command line. A line per frame: time in microseconds, name,
"fd" or "classic", verdict of the E2E check, number of signals, bytes.
"""

import sys

import can
import cantools
from e2e import p05

database = cantools.database.load_file(sys.argv[1])
with can.LogReader(sys.argv[2]) as log:
    for frame in log:
        message = database.get_message_by_frame_id(frame.arbitration_id)
        data_id = message.dbc.attributes["E2EDataId"].value
        signals = message.decode(frame.data)
        verdict = "whole" if p05.e2e_p05_check(bytes(frame.data), data_id) else "damaged"
        kind = "fd" if frame.is_fd and frame.bitrate_switch else "classic"
        print(round(frame.timestamp * 1e6), message.name, kind, verdict, len(signals), frame.data.hex())
