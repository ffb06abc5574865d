"""The automated calibration procedure: from a tape measure to a robot program whose poses are safe, visible and enough.

Dressler (2012), section 5.6. `planning` runs the stages one after another: `settling` (workspace), `candidates`, `choice`,
`tours` on `clear_ways`, `trials`, `verdict`; `stages` keeps what is finished in a folder; `plan` is the result, which
`rapid`, `page` and `files` write. A robot before its calibration is known to the tape measure only: whatever has to be
safe is asked of a `fleet` of robots that the tape measure cannot tell apart.
"""
