"""Prints a measurement file as asammdf reads it, which shares no code with this project.

The file is named on the command line. A line for the file: version and description. A line per group: name and
number of records. A line per channel: name, unit, comment, type, samples. Tabs separate the fields; the samples
are the hexadecimal digits of their bytes, big-endian, or names.
"""

import sys

from asammdf import MDF


def show(*fields):
    print(*(str(field).replace("\n", "\\n") for field in fields), sep="\t")


def samples(measurement, group, index):
    raw = measurement.get(group=group, index=index, raw=True)
    kind = raw.samples.dtype
    if raw.conversion is None:
        return kind.name, raw.samples.astype(kind.newbyteorder(">")).tobytes().hex()
    names = measurement.get(group=group, index=index, raw=False).samples
    return f"names of {kind.name}", " ".join(name.decode() for name in names)


with MDF(sys.argv[1]) as measurement:
    show("file", measurement.version, measurement.header.description)
    for number, group in enumerate(measurement.groups):
        show("group", group.channel_group.acq_name, group.channel_group.cycles_nr)
        assert measurement.masters_db[number] == 0, "the time is the first channel"
        for index, channel in enumerate(group.channels):
            kind, values = samples(measurement, number, index)
            show("channel", channel.name, channel.unit, channel.comment, kind, values)
