// What a world's records are filed under.
#pragma once

#include "generator/terrain/world.h"
#include "protocol/base/coords.h"
#include "server/chunks/build_chunk.h"
#include "storage/chunk_store.h"

namespace terrane {

/// The identity that a store is opened with to hold this world.
inline StoreIdentity store_identity_of(const World& world) {
    return {.fingerprint = world.fingerprint,
            .content_id = content_id_of(world),
            .generator_version = kGeneratorVersion,
            .world_name = world.definition.name};
}

/// Where a stack's bytes (encode_stack) are kept.
constexpr RecordKey stack_record_key(StackPos position) {
    return {.family = Family::stacks,
            .format = 0,
            .position = {.lod = position.lod, .x = position.x, .y = 0, .z = position.z}};
}

}  // namespace terrane
