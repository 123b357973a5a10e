//! The program that runs on the PC of a rig. It parses the command line and runs the command. Its
//! exit code tells whether everything went well.

// These macros panic if the output cannot be written. `cli/out.rs` has replacements that do not.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::completions::answer();
    let arguments = cli::habits::without_cargo_s_dashes(std::env::args_os());
    let done = match cli::Cli::of(&arguments) {
        Ok(cli) => {
            hbot_host::run_loop::signals::outlive_file_limits().map_err(Into::into).and_then(|()| cli.run())
        }
        Err(answer) => cli::out::answer(answer, &arguments),
    };
    done.unwrap_or_else(|error| {
        cli::out::error(&error);
        cli::orders::warn_of_torque(&error);
        cli::out::code(&error)
    })
}
