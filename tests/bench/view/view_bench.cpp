// Measures views against their bars, over TCP on this machine, and prints PASS or MISS for each.
//
//   view_bench [--only cost|flight|crowd|slow|teleport] [--seconds S] [--viewers N] [--workers N]
//              [--json FILE]
//
// cost: an update of a view of 5,202 squares. flight: one viewer at 50 m/s over cold terrain.
// crowd: many viewers on one hot area at once. slow: the same with one client at 64 kbit/s among
// them, in turns. teleport: a viewer that leaves while its place is being made.
#include "tests/bench/bench_world.h"
#include "tests/bench/view/flight.h"
#include "tests/bench/view/view_server.h"

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <barrier>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

namespace terrane::bench {
namespace {

struct Options {
    std::string only;
    double seconds = 60;
    std::size_t viewers = 50;
    std::size_t workers = 2;
    std::string json_path;
};

/// Figures and whether they meet their bars.
class Report {
  public:
    void figure(const std::string& what, double value, const char* unit) {
        std::printf("%-66s %12.3f %s\n", what.c_str(), value, unit);
        json_["figures"][what] = value;
        std::fflush(stdout);
    }

    void bar(const std::string& what, double value, double most, const char* unit) {
        const bool met = value <= most;
        std::printf("%-66s %12.3f %-6s <= %-8g %s\n", what.c_str(), value, unit, most,
                    met ? "PASS" : "MISS");
        std::fflush(stdout);
        json_["bars"].push_back({{"what", what}, {"value", value}, {"bar", most}, {"met", met}});
        all_met_ = all_met_ && met;
    }

    bool all_met() const { return all_met_; }

    const nlohmann::json& json() const { return json_; }

  private:
    nlohmann::json json_;
    bool all_met_ = true;
};

ViewWorld view_world_of(const World& world) {
    const Grid& grid = world.definition.grid;
    return {.side = grid.side,
            .chunk_height = grid.height,
            .height_bound_voxels = world.stack.height_bound,
            .levels = levels_supported()};
}

constexpr double kSpeed = 50;

std::function<Place(double)> straight(double x, double z) {
    return [=](double seconds) {
        return Place{.x = x + kSpeed * seconds, .z = z, .velocity_x = kSpeed, .velocity_z = 0};
    };
}

/// Around a circle of 400 voxels, so that many stay in one area.
std::function<Place(double)> circle(double phase) {
    constexpr double kRadius = 400;
    return [=](double seconds) {
        const double angle = phase + seconds * kSpeed / kRadius;
        return Place{.x = kRadius * std::cos(angle),
                     .z = kRadius * std::sin(angle),
                     .velocity_x = -kSpeed * std::sin(angle),
                     .velocity_z = kSpeed * std::cos(angle)};
    };
}

void check(const FlightFigures& figures) {
    if (!figures.error.empty()) {
        std::fprintf(stderr, "a flight ended early: %s\n", figures.error.c_str());
        std::exit(1);
    }
}

void measure_cost(Report& report) {
    const auto median_us = [](std::size_t count, auto step) {
        std::vector<double> us;
        for (std::size_t i = 0; i < count; ++i) {
            const auto from = Clock::now();
            step();
            us.push_back(std::chrono::duration<double, std::micro>(Clock::now() - from).count());
        }
        return percentile(std::move(us), 0.5);
    };
    const ViewWorld world{
        .side = 32, .chunk_height = 32, .height_bound_voxels = 366, .levels = levels_supported()};
    ViewUpdate update;
    update.direction = {.x = 1, .y = 0, .z = 0.2F};
    update.field_of_view = 1.2F;
    update.velocity = {.x = 50, .y = 0, .z = 0};
    update.radius_chunks = {16, 16, 16, 16, 16, 16};
    View view(world, {});
    report.bar("cost: first update or teleport, 5,202 squares, horizon 512 sides",
               median_us(101,
                         [&] {
                             update.x += 1e6;
                             view.update(update);
                         }),
               1000, "us");
    const auto drain = [&] {
        while (view.has_wish()) {
            view.take();
        }
        while (view.has_forgotten()) {
            view.take_forgotten(4096);
        }
    };
    drain();
    report.bar("cost: update of a viewer at 50 m/s, 20 a second",
               median_us(2000,
                         [&] {
                             update.x += 2.5;
                             view.update(update);
                             drain();
                         }),
               1000, "us");
}

void measure_flight(const Options& options, Report& report,
                    const std::shared_ptr<const World>& world) {
    ViewServer server(world, options.workers, 1);
    FlightPlan plan;
    plan.port = server.port();
    plan.world = view_world_of(*world);
    plan.place = straight(16, 16);
    plan.seconds = options.seconds;
    const FlightFigures figures = fly(plan);
    check(figures);
    report.figure("flight: seconds", options.seconds, "s");
    report.figure("flight: chunks", static_cast<double>(figures.chunks), "");
    report.figure("flight: payload", static_cast<double>(figures.payload_bytes) / 1e6, "MB");
    report.figure("flight: largest payload", static_cast<double>(figures.largest_payload_bytes),
                  "bytes");
    report.figure("flight: the ground underfoot was there after", figures.first_ground_ms, "ms");
    report.figure("flight: the whole first view was there after", figures.complete_ms, "ms");
    report.figure("flight: near chunks that were not there when they came near",
                  static_cast<double>(figures.near_ms.size()), "");
    report.figure("flight: wanted to there, p50", percentile(figures.wanted_ms, 0.5), "ms");
    report.figure("flight: wanted to there, p99", percentile(figures.wanted_ms, 0.99), "ms");
    report.bar("flight: near ring, wanted to there, p99", percentile(figures.near_ms, 0.99), 100,
               "ms");
    report.bar("flight: updates at which the ground underfoot was missing",
               static_cast<double>(figures.underfoot_missing), 0, "");
    report.bar("flight: near chunks that never came", static_cast<double>(figures.near_missed), 0,
               "");
    report.bar("flight: payload out of view when it came",
               100 * static_cast<double>(figures.out_of_view_bytes) /
                   static_cast<double>(figures.payload_bytes),
               5, "%");
    std::map<ChunkPos, int> made;
    std::set<StackPos> stacks;
    int twice = 0;
    double near_work_ms = 0;
    for (const Build& build : server.builds()) {
        if (build.key.lod == 0 && std::abs(build.key.x) <= 1 && std::abs(build.key.z) <= 1) {
            near_work_ms +=
                std::chrono::duration<double, std::milli>(build.ended - build.begun).count();
        }
    }
    report.figure("flight: workers' time for the first near ring", near_work_ms, "ms");
    for (const Build& build : server.builds()) {
        stacks.insert(stack_of(build.key));
        twice += build.is_answer && ++made[build.key] > 1 ? 1 : 0;
    }
    report.bar("flight: chunks made twice", twice, 0, "");
    report.bar("flight: stacks generated more than once",
               static_cast<double>(count_of(server.counters().generations)) -
                   static_cast<double>(stacks.size()),
               0, "");
    report.bar("flight: chunks that came twice", static_cast<double>(figures.twice), 0, "");
}

/// One viewer stands here and there along the way, until all of the area is in the cache.
void heat(const ViewServer& server, const ViewWorld& world, double seconds) {
    for (double angle = 0; angle < 0.5 + 0.15 * seconds; angle += 0.25) {
        FlightPlan plan;
        plan.port = server.port();
        plan.name = "heater";
        plan.world = world;
        plan.place = [at = circle(angle)](double) { return at(0); };
        plan.seconds = 120;
        plan.updates_per_second = 5;
        plan.until_complete = true;
        check(fly(plan));
    }
}

struct Crowd {
    std::vector<FlightFigures> figures;
    std::vector<double> share_bytes;  ///< of each, while all still wanted more
};

/// Everybody at once; with `slow_name`, the first reads at 64 kbit/s only.
Crowd fly_together(const Options& options, const ViewServer& server, FlightPlan pattern,
                   const std::string& slow_name) {
    const double seconds = pattern.seconds;
    Crowd crowd;
    crowd.figures.resize(options.viewers);
    std::vector<std::atomic<std::uint64_t>> received(options.viewers);
    std::barrier all_connected(static_cast<std::ptrdiff_t>(options.viewers));
    {
        std::vector<std::jthread> threads;
        for (std::size_t i = 0; i < options.viewers; ++i) {
            threads.emplace_back([&, i] {
                FlightPlan plan = pattern;
                plan.port = server.port();
                // All on one stretch, so that what they want is the same.
                plan.place = circle(0.01 * static_cast<double>(i));
                plan.connected = [&] { all_connected.arrive_and_wait(); };
                plan.received_bytes = &received[i];
                if (i == 0 && !slow_name.empty()) {
                    plan.name = slow_name;
                    plan.read_bytes_per_second = 8000;
                }
                crowd.figures[i] = fly(plan);
            });
        }
        // Shares are looked at while everybody still wants more: half a view on average.
        constexpr std::uint64_t kLookAt = std::uint64_t{10} << 20U;
        const auto deadline = Clock::now() + std::chrono::duration<double>(seconds);
        while (Clock::now() < deadline && crowd.share_bytes.empty()) {
            std::vector<double> shares;
            double sum = 0;
            for (const auto& bytes : received) {
                shares.push_back(static_cast<double>(bytes.load()));
                sum += shares.back();
            }
            if (sum >= static_cast<double>(kLookAt * received.size())) {
                crowd.share_bytes = std::move(shares);
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    }
    return crowd;
}

void measure_crowd(const Options& options, Report& report,
                   const std::shared_ptr<const World>& world) {
    ViewServer server(world, options.workers, 1);
    const ViewWorld view_world = view_world_of(*world);
    const double seconds = std::min(options.seconds, 20.0);
    heat(server, view_world, seconds);
    const std::uint64_t before = count_of(server.counters().generations);
    FlightPlan pattern;
    pattern.world = view_world;
    pattern.seconds = seconds;
    const Crowd crowd = fly_together(options, server, pattern, "");
    std::vector<double> shares = crowd.share_bytes;
    std::vector<double> wanted_ms;
    std::uint64_t bytes = 0;
    for (const FlightFigures& figures : crowd.figures) {
        check(figures);
        bytes += figures.payload_bytes;
        wanted_ms.insert(wanted_ms.end(), figures.wanted_ms.begin(), figures.wanted_ms.end());
    }
    report.figure("crowd: viewers", static_cast<double>(options.viewers), "");
    report.figure("crowd: payload to all", static_cast<double>(bytes) / 1e6, "MB");
    report.figure("crowd: stacks generated meanwhile",
                  static_cast<double>(count_of(server.counters().generations) - before), "");
    report.figure("crowd: wanted to there, p99", percentile(wanted_ms, 0.99), "ms");
    if (shares.empty()) {
        std::fprintf(stderr, "crowd: not 10 MB each in time; the machine is too busy\n");
        std::exit(1);
    }
    double mean = 0;
    for (const double share : shares) {
        mean += share / static_cast<double>(shares.size());
    }
    const auto [least, most] = std::ranges::minmax(shares);
    report.figure("crowd: least share of a viewer / mean, all wanting more", least / mean, "");
    report.figure("crowd: largest share of a viewer / mean", most / mean, "");
    report.bar("crowd: farthest share from the mean",
               100 * std::max(most / mean - 1, 1 - least / mean), 20, "%");
}

void measure_slow(const Options& options, Report& report,
                  const std::shared_ptr<const World>& world) {
    ViewServer server(world, options.workers, 1);
    const ViewWorld view_world = view_world_of(*world);
    FlightPlan pattern;
    pattern.world = view_world;
    pattern.radii = {8, 8, 8, 8};  // there soon: after half the time it is flight alone
    pattern.seconds = std::clamp(options.seconds / 5, 4.0, 12.0);
    pattern.settle_seconds = pattern.seconds / 2;
    heat(server, view_world, pattern.seconds);
    std::vector<double> p99[2];  // without, with
    std::size_t held_bytes = 0;
    for (int turn = 0; turn < 10; ++turn) {
        const bool with_slow = turn % 2 == 1;
        const std::string name = with_slow ? "slow" + std::to_string(turn) : "";
        const Crowd crowd = fly_together(options, server, pattern, name);
        std::vector<double> wanted_ms;
        for (std::size_t i = 1; i < crowd.figures.size(); ++i) {
            check(crowd.figures[i]);
            const auto& one = crowd.figures[i].wanted_ms;
            wanted_ms.insert(wanted_ms.end(), one.begin(), one.end());
        }
        p99[with_slow ? 1 : 0].push_back(percentile(wanted_ms, 0.99));
        if (with_slow) {
            const auto watch = server.watch(name);
            held_bytes = std::max(held_bytes, watch->outbox_bytes_max.load());
            report.figure("slow: its payload out of view when it came",
                          100 * static_cast<double>(crowd.figures[0].out_of_view_bytes) /
                              static_cast<double>(crowd.figures[0].payload_bytes),
                          "%");
        }
    }
    for (const int which : {0, 1}) {
        for (const double value : p99[which]) {
            report.figure(
                which == 0 ? "slow: the others' p99 without it" : "slow: the others' p99 with it",
                value, "ms");
        }
    }
    const double without = percentile(p99[0], 0.5);
    const double with = percentile(p99[1], 0.5);
    report.bar("slow: the others' median p99, with it over without", 100 * (with / without - 1), 10,
               "%");
    report.bar("slow: the server held for it at most", static_cast<double>(held_bytes), 262144,
               "bytes");
}

void measure_teleport(const Options& options, Report& report,
                      const std::shared_ptr<const World>& world) {
    ViewServer server(world, options.workers, 1);
    constexpr double kLeap = 1e5;
    constexpr double kEvery = 0.5;
    const double seconds = std::min(options.seconds, 10.0);
    FlightPlan plan;
    plan.port = server.port();
    plan.name = "leaper";
    plan.world = view_world_of(*world);
    plan.updates_per_second = 1 / kEvery;  // one an area
    std::vector<Clock::time_point> handled;
    const auto watch = server.watch(plan.name);
    double leaps = 0;
    plan.place = [&](double) {
        // The place before was handled when its input was: look before the next is sent.
        handled.emplace_back(Clock::duration(watch->last_input.load()));
        return Place{.x = kLeap * leaps++, .y = 200, .z = 16, .velocity_x = 0, .velocity_z = 0};
    };
    plan.seconds = seconds;
    const FlightFigures figures = fly(plan);
    check(figures);
    // first_seen[n]: when the workers had begun the first chunk of area n, so its view was handled.
    std::map<int, Clock::time_point> first_seen;
    const auto area_of = [&](const Build& build) {
        const double x = static_cast<double>(build.key.x) * 32 * std::exp2(build.key.lod);
        return static_cast<int>(std::floor(x / kLeap + 0.5));
    };
    const auto builds = server.builds();
    for (const Build& build : builds) {
        auto [seen, is_new] = first_seen.try_emplace(area_of(build), build.begun);
        seen->second = std::min(seen->second, build.begun);
    }
    int late = 0;
    int ended_after = 0;
    for (const Build& build : builds) {
        const auto next = first_seen.find(area_of(build) + 1);
        if (next != first_seen.end()) {
            late += build.begun > next->second ? 1 : 0;
            ended_after += build.ended > next->second && build.begun <= next->second ? 1 : 0;
        }
    }
    report.figure("teleport: places", static_cast<double>(first_seen.size()), "");
    report.figure("teleport: pieces of work", static_cast<double>(builds.size()), "");
    report.figure("teleport: cancelled",
                  static_cast<double>(count_of(server.counters(), &OutcomeCounters::cancelled)),
                  "");
    report.figure("teleport: near ring, wanted to there, p99", percentile(figures.near_ms, 0.99),
                  "ms");
    report.bar("teleport: work of an old place begun after the new one's", late, 0, "");
    report.bar("teleport: work of an old place that was under way then, a leap and worker",
               first_seen.size() < 2
                   ? 0
                   : static_cast<double>(ended_after) / static_cast<double>(first_seen.size() - 1) /
                         static_cast<double>(options.workers),
               1, "");
}

int run(int count, char** arguments) {
    Options options;
    CLI::App app("Measures views against their bars.", "view_bench");
    app.add_option("--only", options.only, "one of cost, flight, crowd, slow, teleport");
    app.add_option("--seconds", options.seconds, "of the flight")->check(CLI::Range(1.0, 3600.0));
    app.add_option("--viewers", options.viewers, "of the crowd")->check(CLI::Range(2, 500));
    app.add_option("--workers", options.workers, "of the server")->check(CLI::Range(1, 64));
    app.add_option("--json", options.json_path, "where the figures are written, too");
    CLI11_PARSE(app, count, arguments);
    const auto world = bench_world("basin");
    Report report;
    const auto wants = [&](const char* name) {
        return options.only.empty() || options.only == name;
    };
    if (wants("cost")) {
        measure_cost(report);
    }
    if (wants("flight")) {
        measure_flight(options, report, world);
    }
    if (wants("teleport")) {
        measure_teleport(options, report, world);
    }
    if (wants("crowd")) {
        measure_crowd(options, report, world);
    }
    if (wants("slow")) {
        measure_slow(options, report, world);
    }
    if (!options.json_path.empty()) {
        std::ofstream(options.json_path) << report.json().dump(2) << '\n';
    }
    return report.all_met() ? 0 : 1;
}

}  // namespace
}  // namespace terrane::bench

int main(int argc, char** argv) {
    return terrane::bench::run(argc, argv);
}
