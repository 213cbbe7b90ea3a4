"""Networks that Heel knows by name: where they come from, where they are kept, and which is used.

No service knows where a file is kept: settings hold the path of a file, and what makes a path of a
name, or takes a network that is there where none is named, is here and asked by what wires.
"""
