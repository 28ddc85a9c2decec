//! Exit codes of the program.

use super::interrupt::INTERRUPTED;

/// What the program's exit codes mean; the first three are those of every command.
pub const EXIT_CODES: [(u8, &str); 6] = [
    (0, "done"),
    (
        1,
        "failed, with a sentence; or `diff` found more than `--max`, `verify` a broken bound, `devices` no usable device",
    ),
    (
        WRONG,
        "wrong usage: an unknown option, a value that is missing, malformed or unknown, or options that contradict",
    ),
    (AGAIN, "worth trying again: the device was lost, or the disk is full"),
    (INTERRUPTED, "ended by Ctrl-C; with `render --keep` the outputs have the samples drawn so far"),
    (ENDED, "a part of a picture that was ended by SIGTERM, with the samples it had"),
];

/// Wrong usage: the code that clap has for command lines that do not parse.
pub const WRONG: u8 = 2;

/// Worth trying again: EX_TEMPFAIL of sysexits.h.
pub const AGAIN: u8 = 75;

/// Ended by SIGTERM, as shells report it: 128 and the signal's number.
pub const ENDED: u8 = 143;
