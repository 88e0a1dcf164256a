#include "server/log.h"

#include "protocol/base/result.h"

#include <nlohmann/json.hpp>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <ctime>
#include <exception>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

namespace terrane {

namespace {

constexpr std::array kLevels{
    std::pair<std::string_view, LogLevel>{"debug", LogLevel::debug},
    std::pair<std::string_view, LogLevel>{"info", LogLevel::info},
    std::pair<std::string_view, LogLevel>{"warning", LogLevel::warning},
    std::pair<std::string_view, LogLevel>{"error", LogLevel::error},
    std::pair<std::string_view, LogLevel>{"off", LogLevel::off},
};

spdlog::level::level_enum spdlog_level(LogLevel level) {
    switch (level) {
        case LogLevel::debug:
            return spdlog::level::debug;
        case LogLevel::info:
            return spdlog::level::info;
        case LogLevel::warning:
            return spdlog::level::warn;
        case LogLevel::error:
            return spdlog::level::err;
        case LogLevel::off:
            break;
    }
    return spdlog::level::off;
}

std::string utc_now() {
    const auto now =
        std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
    const auto seconds = std::chrono::floor<std::chrono::seconds>(now);
    const std::time_t time = std::chrono::system_clock::to_time_t(seconds);
    std::tm parts{};
    gmtime_r(&time, &parts);
    return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z", parts.tm_year + 1900,
                       parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec,
                       (now - seconds).count());
}

}  // namespace

Result<LogFormat> parse_log_format(std::string_view text) {
    if (text == "text") {
        return LogFormat::text;
    }
    if (text == "json") {
        return LogFormat::json;
    }
    return fail(ErrorCode::invalid_argument,
                "log format \"" + std::string(text) + "\": text and json are allowed");
}

Result<LogLevel> parse_log_level(std::string_view text) {
    for (const auto& [name, level] : kLevels) {
        if (name == text) {
            return level;
        }
    }
    return fail(
        ErrorCode::invalid_argument,
        "log level \"" + std::string(text) + "\": debug, info, warning, error and off are allowed");
}

std::string text_line(std::string_view message, std::initializer_list<LogField> fields) {
    std::string line(message);
    for (const LogField& field : fields) {
        line += fmt::format(" {}=", field.name);
        std::visit([&line](const auto& value) { line += fmt::format("{}", value); }, field.value);
    }
    for (char& c : line) {  // whatever a client called itself: one event stays one line
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
            c = '?';
        }
    }
    return line;
}

std::string json_line(std::string_view time, std::string_view level, std::string_view message,
                      std::initializer_list<LogField> fields) {
    nlohmann::ordered_json line{{"time", time}, {"level", level}, {"message", message}};
    for (const LogField& field : fields) {
        std::visit([&](const auto& value) { line[std::string(field.name)] = value; }, field.value);
    }
    return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

struct Log::Impl {
    LogFormat format;
    LogLevel level;
    spdlog::logger logger;
};

Log::Log(LogFormat format, LogLevel level)
    : impl_(new Impl{.format = format,
                     .level = level,
                     .logger = {"terrane", std::make_shared<spdlog::sinks::stderr_sink_mt>()}}) {
    impl_->logger.set_level(spdlog_level(level));
    impl_->logger.flush_on(spdlog::level::debug);
    impl_->logger.set_pattern(format == LogFormat::json ? "%v" : "%Y-%m-%d %H:%M:%S.%e %l: %v",
                              spdlog::pattern_time_type::utc);
}

Log::~Log() = default;

void Log::debug(std::string_view message, std::initializer_list<LogField> fields) const {
    write(LogLevel::debug, message, fields);
}

void Log::info(std::string_view message, std::initializer_list<LogField> fields) const {
    write(LogLevel::info, message, fields);
}

void Log::warning(std::string_view message, std::initializer_list<LogField> fields) const {
    write(LogLevel::warning, message, fields);
}

void Log::error(std::string_view message, std::initializer_list<LogField> fields) const {
    write(LogLevel::error, message, fields);
}

void Log::write(LogLevel level, std::string_view message,
                std::initializer_list<LogField> fields) const {
    if (level < impl_->level) {
        return;
    }
    try {
        const auto name = kLevels[static_cast<std::size_t>(level)].first;
        const std::string line = impl_->format == LogFormat::json
                                     ? json_line(utc_now(), name, message, fields)
                                     : text_line(message, fields);
        impl_->logger.log(spdlog_level(level), spdlog::string_view_t(line.data(), line.size()));
    } catch (const std::exception&) {  // no memory: the line is lost, the server goes on
    }
}

}  // namespace terrane
