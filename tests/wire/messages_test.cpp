#include "protocol/wire/messages.h"

#include "tests/wire/sample_messages.h"

#include <gtest/gtest.h>
#include <terrane_generated.h>

#include <limits>

namespace terrane {
namespace {

Result<AnyMessage> decode(std::span<const std::byte> bytes) {
    FrameReader reader(kOutboundFrameLimits);
    reader.feed(bytes);
    const auto frame = reader.next();
    if (!frame) {
        return tl::unexpected(frame.error());
    }
    if (!*frame) {
        return fail(ErrorCode::internal, "no whole frame");
    }
    return decode_message(**frame);
}

/// Decodes a body built field by field with the generated code, for what our own encoder can't
/// write.
template <typename Build>
Result<AnyMessage> decode_built(Build build) {
    flatbuffers::FlatBufferBuilder builder;
    const auto body = build(builder);
    wire::FinishSizePrefixedMessageBuffer(builder,
                                          wire::CreateMessage(builder, body.first, body.second));
    return decode(
        frame_head(std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize())), 0));
}

ErrorCode code_of(const Result<AnyMessage>& message) {
    return message ? static_cast<ErrorCode>(0) : message.error().code;
}

TEST(Messages, EveryKindSurvivesTheRoundTrip) {
    for (const AnyMessage& message : sample_messages()) {
        const auto decoded = decode(encode_message(message));
        ASSERT_TRUE(decoded) << name_of(message) << ": " << decoded.error().message;
        EXPECT_EQ(*decoded, message) << name_of(message);
    }
}

TEST(Messages, SamplesCoverEveryKind) {
    std::vector<bool> seen(std::variant_size_v<AnyMessage>);
    for (const AnyMessage& message : sample_messages()) {
        seen[message.index()] = true;
    }
    EXPECT_EQ(std::ranges::count(seen, true), std::ssize(seen));
}

TEST(Messages, AFullChunkCountsItsPayload) {
    const ChunkAnswer answer{.request_id = 1,
                             .key = {},
                             .format = ChunkFormat::draco,
                             .status = ChunkStatus::full,
                             .source = ChunkSource::store,
                             .etag = {},
                             .timings = {},
                             .payload_bytes = 3,
                             .uniform = {}};
    Bytes bytes = encode_message(answer);
    for (const int value : {1, 2, 3}) {
        bytes.push_back(static_cast<std::byte>(value));
    }
    const auto decoded = decode(bytes);
    ASSERT_TRUE(decoded) << decoded.error().message;
    EXPECT_EQ(std::get<ChunkAnswer>(*decoded), answer);
}

TEST(Messages, APayloadThatTheHeadDoesNotAnnounceIsMalformed) {
    Bytes bytes = encode_message(Ping{.nonce = 1});
    bytes.push_back(std::byte{0});
    bytes[0] = static_cast<std::byte>(static_cast<int>(bytes[0]) + 1);
    EXPECT_EQ(code_of(decode(bytes)), ErrorCode::malformed);
}

TEST(Messages, RequestOfNoKeysIsInvalid) {
    EXPECT_EQ(code_of(decode(encode_message(ChunkRequest{.request_id = 1,
                                                         .format = {},
                                                         .keys = {},
                                                         .known_etags = {},
                                                         .priority = 0,
                                                         .without_flow = false}))),
              ErrorCode::invalid_argument);
}

TEST(Messages, RequestOf64KeysIsReadAndOf65Refused) {
    ChunkRequest request{.request_id = 1,
                         .format = ChunkFormat::draco,
                         .keys = std::vector<ChunkPos>(kKeysPerRequestMax),
                         .known_etags = {},
                         .priority = 0,
                         .without_flow = false};
    EXPECT_TRUE(decode(encode_message(request)));
    request.keys.emplace_back();
    EXPECT_EQ(code_of(decode(encode_message(request))), ErrorCode::invalid_argument);
}

TEST(Messages, EtagsMustBeAsManyAsKeys) {
    ChunkRequest request{.request_id = 1,
                         .format = ChunkFormat::draco,
                         .keys = std::vector<ChunkPos>(2),
                         .known_etags = std::vector<Hash128>(1),
                         .priority = 0,
                         .without_flow = false};
    EXPECT_EQ(code_of(decode(encode_message(request))), ErrorCode::invalid_argument);
}

TEST(Messages, RequestIdZeroIsTheSession) {
    EXPECT_EQ(code_of(decode(encode_message(WorldQuery{.request_id = 0}))),
              ErrorCode::invalid_argument);
    EXPECT_EQ(code_of(decode(encode_message(ColumnQuery{.request_id = 0, .column = {}}))),
              ErrorCode::invalid_argument);
}

TEST(Messages, FormatsAre0To2AndOthersUnsupported) {
    const auto request_of = [](int format) {
        return decode_built([format](auto& builder) {
            const std::vector<wire::ChunkKey> keys(1);
            const auto keys_at = builder.CreateVectorOfStructs(keys);
            const auto request =
                wire::CreateChunkRequest(builder, 1, static_cast<wire::Format>(format), keys_at);
            return std::pair(wire::Body::ChunkRequest, request.Union());
        });
    };
    for (const ChunkFormat format :
         {ChunkFormat::draco, ChunkFormat::columns, ChunkFormat::draco_blocky, ChunkFormat::glb}) {
        const auto message = request_of(static_cast<int>(format));
        ASSERT_TRUE(message) << message.error().message;
        EXPECT_EQ(std::get<ChunkRequest>(*message).format, format);
        EXPECT_NE(to_string(format), "unknown");
    }
    for (const int format : {4, 200, 255}) {
        EXPECT_EQ(code_of(request_of(format)), ErrorCode::unsupported) << format;
    }
}

TEST(Messages, ColumnsFartherThan2To53AreOutOfRange) {
    for (const std::int64_t far :
         {kColumnCoordinateLimit, -kColumnCoordinateLimit, std::numeric_limits<std::int64_t>::min(),
          std::numeric_limits<std::int64_t>::max()}) {
        EXPECT_EQ(code_of(decode(
                      encode_message(ColumnQuery{.request_id = 1, .column = {.x = far, .z = 0}}))),
                  ErrorCode::out_of_range);
        EXPECT_EQ(code_of(decode(
                      encode_message(ColumnQuery{.request_id = 1, .column = {.x = 0, .z = far}}))),
                  ErrorCode::out_of_range);
    }
}

TEST(Messages, AMaterialOfANewerKindIsWhatItsSolidSays) {
    auto hello = std::get<ServerHello>(sample_messages()[1]);
    hello.materials[0].kind = static_cast<WireMaterialKind>(200);
    hello.materials[1].kind = static_cast<WireMaterialKind>(9);
    const auto read = decode(encode_message(hello));
    ASSERT_TRUE(read);
    const auto& materials = std::get<ServerHello>(*read).materials;
    EXPECT_EQ(materials[0].kind, WireMaterialKind::regular);
    EXPECT_EQ(materials[1].kind, WireMaterialKind::void_);
    EXPECT_EQ(materials[2].kind, WireMaterialKind::water);
}

TEST(Messages, NumbersThatAreNotFiniteAreMalformed) {
    for (const double value :
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 0.0,
          -1.0, 0.0009, 1000.5}) {
        auto hello = std::get<ServerHello>(sample_messages()[1]);
        hello.voxel_size_m = value;
        EXPECT_EQ(code_of(decode(encode_message(hello))), ErrorCode::malformed) << value;
    }
    auto answer = std::get<ChunkAnswer>(sample_messages()[4]);
    answer.uniform[0].concentration = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(code_of(decode(encode_message(answer))), ErrorCode::malformed);
}

TEST(Messages, AViewHasFiniteNumbersAndAFieldOfView) {
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    for (const float value : {kNan, kInfinity, -kInfinity}) {
        std::vector<ViewUpdate> views(9);
        views[0].x = static_cast<double>(value);
        views[1].y = static_cast<double>(value);
        views[2].z = static_cast<double>(value);
        views[3].direction.x = value;
        views[4].direction.y = value;
        views[5].direction.z = value;
        views[6].velocity.x = value;
        views[7].velocity.z = value;
        views[8].field_of_view = value;
        for (const ViewUpdate& view : views) {
            EXPECT_EQ(code_of(decode(encode_message(view))), ErrorCode::invalid_argument);
        }
    }
    for (const float angle : {-0.1F, -1e30F, 6.2832F, 7.0F}) {
        ViewUpdate view;
        view.field_of_view = angle;
        EXPECT_EQ(code_of(decode(encode_message(view))), ErrorCode::invalid_argument) << angle;
    }
    ViewUpdate whole;
    whole.field_of_view = kFieldOfViewMax;
    EXPECT_TRUE(decode(encode_message(whole)));
}

TEST(Messages, AViewerIsWithin2To53OfTheOrigin) {
    constexpr double kEnd = 9007199254740992.0;
    for (const double far : {kEnd, -kEnd, 1e300, -1e300}) {
        for (double ViewUpdate::* axis : {&ViewUpdate::x, &ViewUpdate::y, &ViewUpdate::z}) {
            ViewUpdate view;
            view.*axis = far;
            EXPECT_EQ(code_of(decode(encode_message(view))), ErrorCode::out_of_range) << far;
        }
    }
    ViewUpdate near;
    near.x = kEnd - 1;
    near.z = 1 - kEnd;
    EXPECT_TRUE(decode(encode_message(near)));
}

TEST(Messages, AViewHasAtMostARadiusALevel) {
    ViewUpdate view;
    view.radius_chunks.assign(kViewLevelsMax, 4294967295U);
    EXPECT_TRUE(decode(encode_message(view)));
    view.radius_chunks.push_back(0);
    EXPECT_EQ(code_of(decode(encode_message(view))), ErrorCode::invalid_argument);
    const auto unknown_format = decode_built([](auto& builder) {
        return std::pair(
            wire::Body::ViewUpdate,
            wire::CreateViewUpdate(builder, 0, 0, 0, 0, 0, 0, 0, static_cast<wire::Format>(200))
                .Union());
    });
    EXPECT_EQ(code_of(unknown_format), ErrorCode::unsupported);
}

TEST(Messages, AForgetNamesSomeKeysButNotEndlesslyMany) {
    EXPECT_TRUE(decode(encode_message(ChunkForget{.keys = std::vector<ChunkPos>(1)})));
    EXPECT_TRUE(
        decode(encode_message(ChunkForget{.keys = std::vector<ChunkPos>(kKeysPerForgetMax)})));
    EXPECT_EQ(code_of(decode(encode_message(ChunkForget{}))), ErrorCode::malformed);
    const auto many = decode_built([](auto& builder) {
        const auto keys =
            builder.CreateVectorOfStructs(std::vector<wire::ChunkKey>(kKeysPerForgetMax + 1));
        return std::pair(wire::Body::ChunkForget, wire::CreateChunkForget(builder, keys).Union());
    });
    EXPECT_EQ(code_of(many), ErrorCode::malformed);
}

TEST(Messages, AViewIsWithinWhatAServerVerifies) {
    ViewUpdate view = std::get<ViewUpdate>(sample_messages()[15]);
    view.radius_chunks.assign(kViewLevelsMax, 1);
    FrameReader reader(kInboundFrameLimits);
    reader.feed(encode_message(view));
    const auto frame = reader.next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_TRUE(decode_message(**frame));
}

TEST(Messages, LongOrUnprintableClientNamesAreMalformed) {
    for (const std::string& name : {std::string(kWireNameBytesMax + 1, 'a'), std::string("a\nb")}) {
        const auto message = decode_built([&name](auto& builder) {
            const auto name_at = builder.CreateString(name);
            return std::pair(wire::Body::ClientHello,
                             wire::CreateClientHello(builder, 1, name_at).Union());
        });
        EXPECT_EQ(code_of(message), ErrorCode::malformed);
    }
}

TEST(Messages, LongTextsAreCutBetweenCharacters) {
    std::string reason(kTextBytesMax - 1, 'a');
    reason += "\u00e9";
    const auto decoded = decode(encode_message(Goodbye{.code = std::nullopt, .reason = reason}));
    ASSERT_TRUE(decoded) << decoded.error().message;
    EXPECT_EQ(std::get<Goodbye>(*decoded).reason, std::string(kTextBytesMax - 1, 'a'));
}

TEST(Messages, EmptyAndUnknownBodiesAreErrors) {
    EXPECT_EQ(code_of(decode_built(
                  [](auto&) { return std::pair(wire::Body::NONE, flatbuffers::Offset<void>()); })),
              ErrorCode::malformed);
    EXPECT_EQ(code_of(decode_built([](auto& builder) {
                  return std::pair(static_cast<wire::Body>(99), wire::CreatePing(builder).Union());
              })),
              ErrorCode::unsupported);
}

TEST(Messages, RequestIdIsKnownEvenOfARefusedRequest) {
    const Bytes bytes = encode_message(ChunkRequest{.request_id = 77,
                                                    .format = {},
                                                    .keys = {},
                                                    .known_etags = {},
                                                    .priority = 0,
                                                    .without_flow = false});
    FrameReader reader(kInboundFrameLimits);
    reader.feed(bytes);
    const auto frame = reader.next();
    ASSERT_TRUE(frame && *frame);
    EXPECT_FALSE(decode_message(**frame));
    EXPECT_EQ(request_id_of(**frame), 77U);
}

}  // namespace
}  // namespace terrane
