// One column while a landscape puts it together: what replaces the rock of its layers, and the
// limits that come of both, written from bottom to top. Heights in 1/256 voxel.
#pragma once

#include "generator/volume/limit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace terrane {

/// Palette id and flow as they lie in a limit behind its height: id | flow << 16.
using LimitTail = std::uint64_t;

constexpr std::uint16_t palette_id_of(LimitTail tail) {
    return static_cast<std::uint16_t>(tail & 0xffffU);
}

constexpr LimitTail tail_of(std::uint16_t id, std::int32_t packed_flow) {
    return id | std::uint64_t{static_cast<std::uint32_t>(packed_flow)} << 16U;
}

/// A height in 1/256 voxel.
inline std::int32_t to_256(float voxels) {
    return static_cast<std::int32_t>(std::floor(voxels * 256.0F + 0.5F));
}

/// What lies in low..high whatever the layers are there.
struct Overlay {
    std::int32_t low = 0;
    std::int32_t high = 0;
    LimitTail tail = 0;
};

/// Disjoint overlays, bottom first. Belongs to one thread.
class Overlays {
  public:
    void clear() { overlays_.clear(); }

    bool is_empty() const { return overlays_.empty(); }

    std::size_t size() const { return overlays_.size(); }

    std::span<const Overlay> all() const { return overlays_; }

    /// In place of what is there; nothing if `high` is not above `low`.
    void add(std::int32_t low, std::int32_t high, LimitTail tail);

    /// Removes everything above.
    void cut(std::int32_t top);

  private:
    std::vector<Overlay> overlays_;
};

/// From bottom to top shows `tail`; up to `middle`, if that is above the bottom, it blends out of
/// `from`.
struct Run {
    std::int32_t bottom = 0;
    std::int32_t top = 0;
    std::int32_t middle = 0;
    LimitTail tail = 0;
    LimitTail from = 0;
};

/// Shown where nothing is yet: no tail is this one.
inline constexpr LimitTail kNothingShown = ~LimitTail{0};

/// Writes one limit.
inline void put_limit(Limit* to, std::int32_t y256, LimitTail tail) {
    static_assert(sizeof(Limit) == sizeof y256 + sizeof tail && offsetof(Limit, palette_id) == 4 &&
                  offsetof(Limit, flow) == 6);
    std::memcpy(static_cast<void*>(to), &y256, sizeof y256);
    std::memcpy(&to->palette_id, &tail, sizeof tail);
}

/// Writes runs that follow each other from height 0 on, with overlays in their place. Equal
/// neighbours become one; a blend that an overlay cuts ends there.
class LimitWriter {
  public:
    /// Limits that are written for so many runs and overlays at most.
    static constexpr std::size_t limits_max(std::size_t runs, std::size_t overlays) {
        return 3 * (runs + 2 * overlays) + 1;
    }

    LimitWriter(Limit* out, std::span<const Overlay> overlays) : out_(out), overlays_(overlays) {}

    std::int32_t top() const { return top_; }

    /// What the last limit shows.
    LimitTail shown() const { return shown_; }

    /// Up to here no overlay comes.
    std::int32_t clear_to() const { return overlays_.empty() ? INT32_MAX : overlays_.front().low; }

    /// For those who write limits themselves as far as it is clear: where they go, and where they
    /// went.
    Limit* position() const { return out_; }

    void set_position(Limit* out, std::int32_t top, LimitTail shown) {
        out_ = out;
        top_ = top;
        shown_ = shown;
    }

    void write(Run run) {
        if (run.bottom < top_) {  // an overlay has it
            run.bottom = run.middle = top_;
        }
        while (!overlays_.empty() && overlays_.front().low < run.top && run.bottom < run.top) {
            const Overlay overlay = overlays_.front();
            overlays_ = overlays_.subspan(1);
            if (overlay.low > run.bottom) {
                put({.bottom = run.bottom,
                     .top = overlay.low,
                     .middle = std::min(run.middle, overlay.low),
                     .tail = run.tail,
                     .from = run.from});
            }
            put({.bottom = overlay.low,
                 .top = overlay.high,
                 .middle = overlay.low,
                 .tail = overlay.tail,
                 .from = 0});
            run.bottom = run.middle = overlay.high;
        }
        if (run.bottom < run.top) {
            put(run);
        }
    }

    /// The limit from which on it is void; returns their end.
    Limit* end(std::uint16_t void_id) {
        put_limit(out_++, top_, void_id);
        return out_;
    }

  private:
    void put(const Run& run) {
        const bool blends = run.middle > run.bottom;
        const LimitTail start = blends ? run.from : run.tail;
        if (start == shown_) {
            out_ -= blends ? 0 : 1;  // goes on with what is there
        } else {
            put_limit(out_++, run.bottom, start);
        }
        if (blends && run.middle < run.top) {
            put_limit(out_++, run.middle, run.tail);
        }
        put_limit(out_++, run.top, run.tail);
        shown_ = run.tail;
        top_ = run.top;
    }

    Limit* out_;
    std::span<const Overlay> overlays_;  ///< those to come
    std::int32_t top_ = 0;
    LimitTail shown_ = kNothingShown;
};

}  // namespace terrane
