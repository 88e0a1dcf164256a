// The flags that say how to come in, the same for every subcommand that takes them.
#pragma once

#include "client-sample/cpp/connection.h"

#include <CLI/CLI.hpp>

#include <string>

namespace terrane {

/// What is added to `app` refers to `token` and `tls`: they outlive it.
inline void add_door_flags(CLI::App& app, std::string& token, TlsUse& tls) {
    app.add_option("--token", token, "Lets you in where a server asks for one")
        ->envname("TERRANE_TOKEN");
    CLI::Option* const with_tls =
        app.add_flag("--tls", tls.enabled,
                     "Speak TLS, and check that the server's certificate is good for HOST");
    app.add_option("--ca", tls.ca_file, "PEM certificates to trust instead of the system's")
        ->needs(with_tls)
        ->type_name("FILE");
}

}  // namespace terrane
