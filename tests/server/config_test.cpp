// The settings of `terrane serve`, from files and flags.
#include "server/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace terrane {
namespace {

using testing::HasSubstr;

TEST(Config, PrintsAFileThatReadsBackAsTheSame) {
    ServerConfig config;
    config.world = "/a \"b\"\\c.toml";
    config.data = "/data";
    config.anonymous = "no";
    config.publish_world = false;
    config.workers = 3;
    config.cache_mib = 7;
    ServerConfig read;
    const auto outcome = set_from_toml(read, config_toml(config), "server.toml");
    ASSERT_TRUE(outcome) << outcome.error().message;
    EXPECT_EQ(read, config);
}

TEST(Config, TakesFromAFileOnlyWhatStandsThere) {
    ServerConfig config;
    ASSERT_TRUE(set_from_toml(config, "cache_mib = 5\nworld = \"w.toml\"\ndata = \"/d\"\n",
                              "/etc/terrane/server.toml"));
    ServerConfig expected;
    expected.cache_mib = 5;
    expected.world = "/etc/terrane/w.toml";
    expected.data = "/d";
    EXPECT_EQ(config, expected);
}

TEST(Config, NamesEveryFaultAndItsPlaceAndChangesNothing) {
    ServerConfig config;
    const auto outcome = set_from_toml(config,
                                       "cache_mb = 1\nworkers = 0\nstore = \"paper\"\n"
                                       "publish_world = \"yes\"\nio_threads = 2\n",
                                       "s.toml");
    ASSERT_FALSE(outcome);
    for (const char* fault :
         {"s.toml:1:1: cache_mb: is not a known key; the nearest known one is \"cache_mib\"",
          "s.toml:2:11: workers: it must be an integer within 1..256",
          "s.toml:3:9: store: \"paper\" is not one of rocksdb, memory",
          "s.toml:4:17: publish_world: it must be true or false"}) {
        EXPECT_THAT(outcome.error().message, HasSubstr(fault));
    }
    EXPECT_EQ(config, ServerConfig());
    EXPECT_THAT(set_from_toml(config, "a = = 1", "s.toml").error().message, HasSubstr("s.toml:1:"));
    EXPECT_FALSE(set_from_file(config, "/no/such/file.toml"));
}

TEST(Config, TakesEverySettingAsAFlag) {
    for (const Setting& setting : settings()) {
        ServerConfig config;
        EXPECT_EQ(flag_of(setting).substr(0, 2), "--");
        const auto set = set_value(config, setting, value_text(ServerConfig(), setting));
        EXPECT_TRUE(set) << setting.key;
        EXPECT_EQ(config, ServerConfig());
        if (std::holds_alternative<Setting::Number>(setting.member)) {
            for (const char* wrong : {"", "-1", "1x", " 1", "99999999999999999999"}) {
                EXPECT_FALSE(set_value(config, setting, wrong)) << setting.key << wrong;
            }
        }
        if (!setting.allowed.empty() || std::holds_alternative<Setting::Flag>(setting.member)) {
            EXPECT_FALSE(set_value(config, setting, "perhaps")) << setting.key;
        }
    }
}

}  // namespace
}  // namespace terrane
