// The command line: parses, runs one subcommand, and turns its outcome into an exit code.
#pragma once

namespace CLI {
class App;
}

namespace terrane {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitWrongUse = 2;

/// Runs `terrane` with these arguments. Prints to stdout and stderr; never throws.
int run_program(int argc, char** argv);

// Each adds one subcommand. Its callback stores the exit code in `exit_code`; `exit_code` and `app`
// outlive the parse.
void add_preseed_command(CLI::App& app, int& exit_code);
void add_serve_command(CLI::App& app, int& exit_code);
void add_token_command(CLI::App& app, int& exit_code);
void add_verify_command(CLI::App& app, int& exit_code);
void add_world_command(CLI::App& app, int& exit_code);
void add_column_command(CLI::App& app, int& exit_code);
void add_map_command(CLI::App& app, int& exit_code);
void add_slice_command(CLI::App& app, int& exit_code);
void add_picture_command(CLI::App& app, int& exit_code);
void add_report_command(CLI::App& app, int& exit_code);

}  // namespace terrane
