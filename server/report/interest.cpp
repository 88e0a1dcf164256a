#include "generator/terrain/generate_stack.h"
#include "generator/terrain/region.h"
#include "generator/terrain/world.h"
#include "generator/volume/limit.h"
#include "generator/world/composition.h"
#include "protocol/base/result.h"
#include "server/report/chart.h"
#include "server/report/metrics.h"
#include "server/report/numbers.h"
#include "server/report/page.h"
#include "server/report/report_options.h"
#include "server/report/shipped_world.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <string>
#include <vector>

namespace terrane {
namespace {

constexpr std::int32_t kTile = 64;
constexpr double kWalker = 2;           // voxels of head room to get from one column to the next
constexpr std::size_t kSystemMin = 30;  // columns: smaller hollows are no caves to speak of

/// Room to be in: a cave's interval of one column, or the sky above it.
struct Room {
    double floor = 0;
    double lid = 0;
    bool sky = false;
};

/// A square of columns as an explorer meets it.
struct Region {
    std::int32_t side = 0;
    std::vector<std::size_t> first_room;  ///< a column's first room; one more at the end
    std::vector<Room> rooms;
    std::vector<std::uint8_t> has_vein;
    std::vector<double> vein_depth;  ///< from the ground down to the topmost vein
};

/// Where the hunt stands; parents of a disjoint-set forest over rooms.
class Groups {
  public:
    explicit Groups(std::size_t count) : parent_(count) {
        std::iota(parent_.begin(), parent_.end(), std::size_t{0});
    }

    std::size_t find(std::size_t i) {
        while (parent_[i] != i) {
            parent_[i] = parent_[parent_[i]];
            i = parent_[i];
        }
        return i;
    }

    void join(std::size_t a, std::size_t b) { parent_[find(a)] = find(b); }

  private:
    std::vector<std::size_t> parent_;
};

void add_column(Region& region, std::span<const Limit> limits, const Palette& palette) {
    region.first_room.push_back(region.rooms.size());
    double ground = 0;
    double vein_top = -1;
    bool open = false;  // the last room is a cave that nothing covers
    for (std::size_t i = 0; i + 1 < limits.size(); ++i) {
        const double begin = limits[i].y256 / 256.0;
        const double end = limits[i + 1].y256 / 256.0;
        const PaletteKind kind = palette[limits[i].palette_id].kind;
        if (end <= begin) {
            continue;
        }
        if (kind == PaletteKind::cave) {
            if (open) {
                region.rooms.back().lid = end;
            } else {
                region.rooms.push_back({.floor = begin, .lid = end, .sky = false});
            }
            open = true;
            continue;
        }
        open = false;
        ground = end;
        vein_top = kind == PaletteKind::vein ? end : vein_top;
    }
    if (open) {
        region.rooms.back() = {.floor = region.rooms.back().floor, .lid = 1e9, .sky = true};
    } else {
        region.rooms.push_back({.floor = ground, .lid = 1e9, .sky = true});
    }
    region.has_vein.push_back(vein_top >= 0 ? 1 : 0);
    if (vein_top >= 0) {
        region.vein_depth.push_back(ground - vein_top);
    }
}

Result<Region> region_of(const World& world, std::int32_t side) {
    StackGenerator generator(world);
    Region region{.side = side, .first_room = {}, .rooms = {}, .has_vein = {}, .vein_depth = {}};
    std::vector<ColumnSet> row(static_cast<std::size_t>(side / kTile));
    for (std::int32_t z = 0; z < side; ++z) {
        for (std::int32_t x = 0; x < side; x += kTile) {
            ColumnSet& set = row[static_cast<std::size_t>(x / kTile)];
            if (z % kTile == 0) {
                const ColumnRectangle rectangle{
                    .x0 = 2000 + x, .z0 = 2000 + z, .width = kTile, .length = kTile};
                if (auto made = generator.generate(set, rectangle); !made) {
                    return tl::unexpected(made.error());
                }
            }
            for (std::int32_t i = 0; i < kTile; ++i) {
                add_column(region, set.columns.column(i, z % kTile), set.palette);
            }
        }
    }
    region.first_room.push_back(region.rooms.size());
    return region;
}

struct CaveNumbers {
    std::size_t systems = 0;    ///< connected caves
    std::size_t reachable = 0;  ///< of them, those with a way in from the surface
    double open_share = 0;      ///< of all cave room
    double room_share = 0;      ///< cave room per column, voxels
};

void join_columns(Groups& groups, const Region& region, std::size_t a, std::size_t b) {
    for (std::size_t i = region.first_room[a]; i < region.first_room[a + 1]; ++i) {
        for (std::size_t j = region.first_room[b]; j < region.first_room[b + 1]; ++j) {
            const Room& one = region.rooms[i];
            const Room& other = region.rooms[j];
            if (std::min(one.lid, other.lid) - std::max(one.floor, other.floor) >= kWalker) {
                groups.join(i, j);
            }
        }
    }
}

CaveNumbers explore(const Region& region) {
    Groups groups(region.rooms.size());
    const auto side = static_cast<std::size_t>(region.side);
    for (std::size_t z = 0; z < side; ++z) {
        for (std::size_t x = 0; x < side; ++x) {
            const std::size_t column = z * side + x;
            if (x + 1 < side) {
                join_columns(groups, region, column, column + 1);
            }
            if (z + 1 < side) {
                join_columns(groups, region, column, column + side);
            }
        }
    }
    // Two systems that both open to the sky are one group there; so caves are also grouped without
    // it, and each such group asked whether a room of it is with the sky.
    Groups caves(region.rooms.size());
    Region without_sky = region;
    for (Room& room : without_sky.rooms) {
        room.lid = room.sky ? room.floor : room.lid;
    }
    for (std::size_t column = 0; column < side * side; ++column) {
        if (column % side + 1 < side) {
            join_columns(caves, without_sky, column, column + 1);
        }
        if (column + side < side * side) {
            join_columns(caves, without_sky, column, column + side);
        }
    }
    std::vector<std::uint8_t> with_sky(region.rooms.size());
    for (std::size_t i = 0; i < region.rooms.size(); ++i) {
        if (region.rooms[i].sky) {
            with_sky[groups.find(i)] = 1;
        }
    }
    std::vector<std::size_t> columns(region.rooms.size());
    std::vector<std::uint8_t> reached(region.rooms.size());
    double room = 0;
    double open = 0;
    for (std::size_t i = 0; i < region.rooms.size(); ++i) {
        if (region.rooms[i].sky) {
            continue;
        }
        const bool in = with_sky[groups.find(i)] != 0;
        const double height = region.rooms[i].lid - region.rooms[i].floor;
        columns[caves.find(i)] += 1;
        reached[caves.find(i)] = static_cast<std::uint8_t>(reached[caves.find(i)] | (in ? 1 : 0));
        room += height;
        open += in ? height : 0;
    }
    CaveNumbers numbers{.open_share = room > 0 ? open / room : 0,
                        .room_share = room / static_cast<double>(side * side)};
    for (std::size_t i = 0; i < columns.size(); ++i) {
        if (columns[i] >= kSystemMin) {
            ++numbers.systems;
            numbers.reachable += reached[i];
        }
    }
    return numbers;
}

/// Columns to walk to the nearest one with a vein, by two passes of steps of 1 and sqrt 2.
std::vector<double> walks(const Region& region) {
    const std::int32_t side = region.side;
    const auto index_of = [&](std::int32_t x, std::int32_t z) {
        return static_cast<std::size_t>(z) * static_cast<std::size_t>(side) +
               static_cast<std::size_t>(x);
    };
    std::vector<double> away(region.has_vein.size());
    std::ranges::transform(region.has_vein, away.begin(),
                           [](std::uint8_t has) { return has != 0 ? 0.0 : 1e9; });
    const auto pass = [&](std::int32_t sign) {
        for (std::int32_t i = 0; i < side; ++i) {
            for (std::int32_t j = 0; j < side; ++j) {
                const std::int32_t z = sign > 0 ? i : side - 1 - i;
                const std::int32_t x = sign > 0 ? j : side - 1 - j;
                double& here = away[index_of(x, z)];
                const auto step = [&](std::int32_t dx, std::int32_t dz, double length) {
                    const std::int32_t u = x + dx * sign;
                    const std::int32_t v = z + dz * sign;
                    if (u >= 0 && v >= 0 && u < side && v < side) {
                        here = std::min(here, away[index_of(u, v)] + length);
                    }
                };
                step(-1, 0, 1);
                step(0, -1, 1);
                step(-1, -1, std::sqrt(2.0));
                step(1, -1, std::sqrt(2.0));
            }
        }
    };
    pass(1);
    pass(-1);
    return away;
}

}  // namespace

Result<void> write_interest(Page& page, const ReportOptions& options) {
    LineChart walk{.title = "How far it is to the next vein",
                   .x_label = "columns to walk, at most",
                   .y_label = "% of places",
                   .series = {},
                   .log_x = false,
                   .log_y = false,
                   .width = 720};
    ReportTable table{
        .name = "interest",
        .title = "Squares of " + std::to_string(options.region_columns) + " columns a side",
        .head = {"", "caves", "of them open to the surface", "cave room reached on foot",
                 "cave room, voxels a column", "median walk to a vein, columns",
                 "median depth of the first vein, voxels"},
        .rows = {}};
    for (const char* name : {"basin", "ore-mountain", "fantasy"}) {
        const auto world = World::build(shipped_definition(name));
        if (!world) {
            return tl::unexpected(world.error());
        }
        const auto region = region_of(*world, options.region_columns);
        if (!region) {
            return tl::unexpected(region.error());
        }
        const CaveNumbers caves = explore(*region);
        std::vector<double> away = walks(*region);
        std::ranges::sort(away);
        LineSeries series{.name = name, .points = {}};
        for (const int reach : {0, 5, 10, 20, 30, 40, 60, 80, 100}) {
            const auto within = std::ranges::upper_bound(away, reach + 0.5) - away.begin();
            series.points.push_back(
                {static_cast<double>(reach),
                 100 * static_cast<double>(within) / static_cast<double>(away.size())});
        }
        walk.series.push_back(series);
        table.rows.push_back({name, std::to_string(caves.systems), std::to_string(caves.reachable),
                              fixed(100 * caves.open_share, 0) + " %", fixed(caves.room_share, 2),
                              fixed(summarize(away).median, 0),
                              fixed(summarize(region->vein_depth).median, 0)});
    }
    page.table(table);
    page.chart("interest-veins", walk);
    page.paragraph(
        "A cave here is all hollow room that hangs together with two voxels of height from column "
        "to column, at least 30 columns of it; it is open if a walker gets in from under the sky "
        "without digging. The terrain is endless, so it can be explored. Whether it "
        "<em>motivates</em> to is for players to say: a number can't show it, and the paper asks "
        "for surveys too. Like the paper's, these caves are single rooms, not systems of "
        "passages.");
    return {};
}

}  // namespace terrane
