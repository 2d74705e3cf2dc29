#!/usr/bin/env python3
"""Makes the packets in a file again with tevclient, tev's own Python module, and says whether the bytes are the same.

usage: oracle.py FILE
"""

import struct
import sys

import numpy
from tevclient import packet

CREATE, UPDATE = 4, 6


class Reader:
    """Takes values from the front of a packet."""

    def __init__(self, data):
        self.data, self.at = data, 0

    def numbers(self, form):
        """Values of these struct formats."""
        values = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return values

    def text(self):
        """A string up to its NUL."""
        end = self.data.index(b"\0", self.at)
        text = self.data[self.at : end].decode()
        self.at = end + 1
        return text


def again(data):
    """The packet that tevclient makes of what this one says."""
    reader = Reader(data)
    _, kind, focus = reader.numbers("IB?")
    name = reader.text()
    if kind == CREATE:
        width, height, count = reader.numbers("3i")
        return packet.create_image(name, width, height, [reader.text() for _ in range(count)], focus)
    if kind != UPDATE:
        sys.exit(f"error: packet type {kind}, expected {CREATE} or {UPDATE}")
    (count,) = reader.numbers("i")
    channels = [reader.text() for _ in range(count)]
    x, y, width, height = reader.numbers("4i")
    reader.numbers(f"{2 * count}q")
    tile = numpy.frombuffer(data, "<f4", offset=reader.at).reshape(height, width, count)
    return packet.update_image(name, tile, channels, x, y, focus)


def main():
    """Reads the file, compares packet by packet."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with open(sys.argv[1], "rb") as file:
        data = file.read()
    at = count = 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        one = data[at : at + length]
        if bytes(again(one)) != one:
            sys.exit(f"error: packet {count}, {length} bytes at {at}: tevclient makes other bytes of it")
        at, count = at + length, count + 1
    print(f"{count} packets are the same")


if __name__ == "__main__":
    main()
