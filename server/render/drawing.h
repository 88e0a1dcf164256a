// What a worker lends to whoever draws a picture of the world.
#pragma once

#include "generator/terrain/generate_stack.h"
#include "generator/terrain/world.h"
#include "protocol/base/result.h"

#include <stop_token>

namespace terrane {

/// Everything outlives the drawing; nothing of it changes what is drawn.
struct Drawing {
    const World* world = nullptr;
    StackGenerator* generator = nullptr;
    std::stop_token stop = {};  ///< asked now and then: a drawing fails with `cancelled`
};

inline Result<void> go_on(const Drawing& drawing) {
    if (drawing.stop.stop_requested()) {
        return fail(ErrorCode::cancelled, "nobody waits for the picture any more");
    }
    return {};
}

}  // namespace terrane
