// terrane-client's command line: parses, runs one subcommand, and turns its outcome into an exit
// code.
#pragma once

namespace CLI {
class App;
}

namespace terrane {

inline constexpr int kClientDone = 0;
inline constexpr int kClientFailed = 1;
inline constexpr int kClientWrongUse = 2;

/// Runs `terrane-client` with these arguments. Prints to stdout and stderr; never throws.
int run_client_program(int argc, const char* const* argv);

/// Adds `get`. Its callback stores the exit code in `exit_code`; both outlive the parse.
void add_get_command(CLI::App& app, int& exit_code);

}  // namespace terrane
