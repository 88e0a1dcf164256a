// The log: one line an event, as text for people or as JSON for programs, on standard error.
#pragma once

#include "protocol/base/result.h"

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <variant>

namespace terrane {

enum class LogFormat : std::uint8_t { text, json };
enum class LogLevel : std::uint8_t { debug, info, warning, error, off };

/// Fail with `invalid_argument` and what is allowed.
Result<LogFormat> parse_log_format(std::string_view text);
Result<LogLevel> parse_log_level(std::string_view text);

/// A value beside the message: `name=value` in text, a member in JSON.
struct LogField {
    std::string_view name;
    std::variant<std::int64_t, std::uint64_t, double, std::string> value;
};

/// One line: UTC time, level, message, fields; without a line end. Invalid UTF-8 is replaced in
/// JSON.
std::string text_line(std::string_view message, std::initializer_list<LogField> fields);
std::string json_line(std::string_view time, std::string_view level, std::string_view message,
                      std::initializer_list<LogField> fields);

/// Any thread. A line is written whole. Never throws.
class Log {
  public:
    Log(LogFormat format, LogLevel level);
    ~Log();
    Log(const Log&) = delete;
    Log& operator=(const Log&) = delete;

    void debug(std::string_view message, std::initializer_list<LogField> fields = {}) const;
    void info(std::string_view message, std::initializer_list<LogField> fields = {}) const;
    void warning(std::string_view message, std::initializer_list<LogField> fields = {}) const;
    void error(std::string_view message, std::initializer_list<LogField> fields = {}) const;

  private:
    void write(LogLevel level, std::string_view message,
               std::initializer_list<LogField> fields) const;

    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace terrane
