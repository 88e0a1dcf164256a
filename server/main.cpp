// terrane: one program, one subcommand a file in server/cli.
//
// Exit codes: 0 done, 1 failed, 2 wrong use (a bad flag or world file).
#include "server/cli/program.h"

int main(int argc, char** argv) {
    return terrane::run_program(argc, argv);
}
