"""What holds for every test."""

from __future__ import annotations

from services.capture.quiet import silence_decoders

# FFmpeg reads its log level when the first video of a process is opened; in the suite that may be
# a test's own video, long before capture is asked for one.
silence_decoders()
