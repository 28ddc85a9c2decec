//! What shaders become when every call is inlined: `cargo run -p etalon-reflect --example inlined`, or with the name of
//! a stage (`path.comp`) for its functions.

use std::path::Path;
use std::process::ExitCode;

#[allow(clippy::print_stdout, clippy::print_stderr, reason = "a program's output")]
fn main() -> ExitCode {
    let stages = match etalon_reflect::inlined(Path::new("shaders")) {
        Ok(stages) => stages,
        Err(message) => {
            eprintln!("{message}");
            return ExitCode::FAILURE;
        }
    };
    if let Some(name) = std::env::args().nth(1) {
        let Some(shares) = stages.get(&name) else {
            eprintln!("counting the functions of {name}: shaders/pass has no such file");
            return ExitCode::FAILURE;
        };
        println!("instructions, of them in one copy, copies, function");
        for share in shares.iter().take(60) {
            println!("{:8} {:8} {:5}  {}", share.copies * share.whole, share.whole, share.copies, share.function);
        }
        return ExitCode::SUCCESS;
    }
    println!("instructions by stage");
    for (name, shares) in &stages {
        println!("{:8}  {name}", shares.first().map_or(0, |entry| entry.whole));
    }
    println!("by function, without those that it calls: instructions, copies, function");
    for (function, copies, instructions) in etalon_reflect::by_function(&stages).iter().take(40) {
        println!("{instructions:8} {copies:5}  {function}");
    }
    ExitCode::SUCCESS
}
