// terrane-client: fetches chunks from a Terrane server and checks what it got.
//
// Exit codes: 0 done, 1 failed, 2 wrong use.
#include "client-sample/cpp/program/program.h"

int main(int argc, char** argv) {
    return terrane::run_client_program(argc, argv);
}
