//! The `relt` program: see [`relt::cli`].

fn main() -> std::process::ExitCode {
    relt::cli::main()
}
