// The program ball_sim_run: its files, exit codes and complaints, as a user meets them.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace {

const std::string kScenes = std::string(BALL_SIM_SOURCE_DIR) + "/config/scenes/";

class BallSimRun : public testing::Test {
 protected:
  void SetUp() override {
    const std::string test = testing::UnitTest::GetInstance()->current_test_info()->name();
    folder_ = std::filesystem::temp_directory_path() /
              ("ball_sim_run_test_" + std::to_string(getpid()) + "_" + test);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string file(const std::string& name) const { return (folder_ / name).string(); }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
    return file(name);
  }

  std::string read(const std::string& name) const {
    std::ifstream stream(file(name));
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  // Runs the program. @return its exit code; what it said is in out_ and err_
  int run(const std::string& arguments) {
    const std::string command = std::string("'") + BALL_SIM_RUN + "' " + arguments + " > '" +
                                file("stdout") + "' 2> '" + file("stderr") + "' < /dev/null";
    const int status = std::system(command.c_str());
    out_ = read("stdout");
    err_ = read("stderr");
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  std::vector<std::vector<double>> rows(const std::string& name, const std::string& header) const {
    std::istringstream text(read(name));
    std::string line;
    std::getline(text, line);
    EXPECT_EQ(line, header);
    std::vector<std::vector<double>> rows;
    while (std::getline(text, line)) {
      rows.emplace_back();
      std::istringstream fields(line);
      std::string field;
      while (std::getline(fields, field, ',')) rows.back().push_back(std::stod(field));
    }
    return rows;
  }

  std::filesystem::path folder_;
  std::string out_;
  std::string err_;
};

constexpr const char* kStates = "time,id,x,y,z,vx,vy,vz";
constexpr const char* kEvents = "time,a,b,nx,ny,nz,impulse";

TEST_F(BallSimRun, WritesStatesThatFollowTheFold) {
  // Eight bounces of one ball between walls 1 m apart, radius 0.1 m: exact in binary but for 0.1.
  const std::string scene = write("s.yaml",
                                  "box: {min: [0, 0, 0], max: [1, 1, 1]}\n"
                                  "balls: [{position: [0.3, 0.5, 0.5], velocity: [0.7, 0, 0], "
                                  "radius: 0.1, mass: 2}]\n");
  ASSERT_EQ(run(scene + " --until 10 --every 0.3 --out " + file("o.csv")), 0) << err_;
  const auto states = rows("o.csv", kStates);
  ASSERT_EQ(states.size(), 35u);  // 0, 0.3 .. 9.9, and 10
  for (std::size_t k = 0; k < states.size(); ++k) {
    const double t = k + 1 < states.size() ? static_cast<double>(k) * 0.3 : 10;
    EXPECT_EQ(states[k][0], t);
    EXPECT_EQ(states[k][1], 0);
    const double u = std::fmod(0.2 + 0.7 * t, 1.6);
    EXPECT_NEAR(states[k][2], 0.1 + (u < 0.8 ? u : 1.6 - u), 1e-14);  // roundings of a few bounces
    EXPECT_EQ(states[k][3], 0.5);
    EXPECT_EQ(std::abs(states[k][5]), 0.7);
  }
}

TEST_F(BallSimRun, WritesStartAndEndAlone) {
  ASSERT_EQ(run(kScenes + "newtons_cradle.yaml --until 0.1 --out " + file("o.csv")), 0) << err_;
  const auto states = rows("o.csv", kStates);
  ASSERT_EQ(states.size(), 10u);
  EXPECT_EQ(states[4][0], 0);
  EXPECT_EQ(states[4][1], 4);
  EXPECT_EQ(states[5][0], 0.1);
  // 17 digits bring the double back that was written.
  EXPECT_EQ(states[5][2], -0.4 + 0.5 * 0.1);
}

TEST_F(BallSimRun, WritesImpactsAndWalls) {
  const std::string scene =
      write("s.yaml",
            "box: {min: [0, 0, -.inf], max: [4, .inf, .inf]}\nplanes: [{normal: [0, -1, 0], "
            "offset: -3}]\n"
            "balls:\n"
            "  - {position: [1, 1, 0], velocity: [1, 0, 0], radius: 0.25, mass: 1}\n"
            "  - {position: [2, 1, 0], radius: 0.25, mass: 1}\n"
            "  - {position: [3, 2, 0], velocity: [0, 1, 0], radius: 0.25, mass: 3}\n");
  ASSERT_EQ(run(scene + " --until 2.4 --events " + file("e.csv")), 0) << err_;
  // At 0.5 s the first ball stops and the second goes on to the wall x = 4, 1.75 m away; the third
  // meets plane 0, y = 3, at 0.75 s and the wall y = 0 at 3.25 s. Impulses: m v, 2 m v.
  const std::vector<std::vector<double>> expected = {
      {0.5, 0, 1, 1, 0, 0, 1}, {0.75, 2, -7, 0, 1, 0, 6}, {2.25, 1, -2, 1, 0, 0, 2}};
  EXPECT_EQ(rows("e.csv", kEvents), expected);
}

TEST_F(BallSimRun, WritesStatistics) {
  ASSERT_EQ(run(kScenes + "two_balls.yaml --until 10 --stats " + file("s.json")), 0) << err_;
  const YAML::Node stats = YAML::LoadFile(file("s.json"));  // JSON is YAML
  for (const char* key :
       {"balls", "until", "method", "method_reason", "ball_collisions", "wall_collisions", "events",
        "wall_seconds", "cpu_seconds", "kinetic_energy_before", "kinetic_energy_after",
        "energy_drift", "momentum_before", "momentum_after", "deepest_overlap", "compressibility",
        "bytes_per_ball", "state_hash"}) {
    EXPECT_TRUE(stats[key].IsDefined()) << key;
  }
  EXPECT_EQ(stats["balls"].as<int>(), 2);
  EXPECT_EQ(stats["until"].as<double>(), 10);
  EXPECT_EQ(stats["reached"].as<double>(), 10);
  EXPECT_EQ(stats["ball_collisions"].as<int>(), 1);
  EXPECT_EQ(stats["wall_collisions"].as<int>(), 0);
  EXPECT_GE(stats["events"].as<int>(), 1);
  EXPECT_EQ(stats["kinetic_energy_before"].as<double>(), 49);
  EXPECT_NEAR(stats["energy_drift"].as<double>(), 0, 1e-15);
  EXPECT_EQ(stats["momentum_before"].as<std::vector<double>>(), (std::vector<double>{1, 8, -11}));
  EXPECT_TRUE(stats["compressibility"].IsNull());
  EXPECT_GT(stats["bytes_per_ball"].as<double>(), 0);
  EXPECT_EQ(stats["state_hash"].as<std::string>().size(), 16u);
  EXPECT_TRUE(stats["error"].IsNull());
}

TEST_F(BallSimRun, WarnsOnceWhereThePolicyDecides) {
  const auto row = [&](const std::string& name, int mass) {
    return write(name,
                 "balls:\n"
                 "  - {position: [0, 0, 0], velocity: [1, 0, 0], radius: 0.5, mass: 1}\n"
                 "  - {position: [1, 0, 0], radius: 0.5, mass: " +
                     std::to_string(mass) +
                     "}\n"
                     "  - {position: [2, 0, 0], velocity: [-1, 0, 0], radius: 0.5, mass: 1}\n");
  };
  ASSERT_EQ(run(row("open.yaml", 2) + " --until 1 --stats " + file("s.json")), 0) << err_;
  EXPECT_NE(err_.find("simultaneous_impacts is sequential"), std::string::npos) << err_;
  EXPECT_EQ(std::count(err_.begin(), err_.end(), '\n'), 1) << err_;
  EXPECT_GT(YAML::LoadFile(file("s.json"))["ambiguous_impacts"].as<int>(), 0);
  ASSERT_EQ(run(row("settled.yaml", 1) + " --until 1"), 0) << err_;
  EXPECT_EQ(err_, "") << "equal balls in a row need no policy";
}

TEST_F(BallSimRun, MeasuresCompressibility) {
  const std::string scene = write("s.yaml",
                                  "box: {min: [-.inf, -.inf, -.inf], max: [.inf, .inf, .inf]}\n"
                                  "periodic: true\n"
                                  "fill: [{count: 500, radius: 0.5, mass: 1, speed_sigma: 1, "
                                  "seed: 7, packing_fraction: 0.2}]\n");
  ASSERT_EQ(run(scene + " --until 60 --stats " + file("s.json")), 0) << err_;
  const YAML::Node stats = YAML::LoadFile(file("s.json"));
  const double collisions = stats["ball_collisions"].as<double>();
  EXPECT_GT(collisions, 10000);
  // Carnahan, Starling (1969), good to 0.3 % here; beside it 4/sqrt(collisions) + 2/N of Z - 1.
  const double eta = 0.2;
  const double z = (1 + eta + eta * eta - eta * eta * eta) / std::pow(1 - eta, 3);
  EXPECT_NEAR(stats["compressibility"].as<double>(), z,
              0.003 * z + (z - 1) * (4 / std::sqrt(collisions) + 2.0 / 500));
}

TEST_F(BallSimRun, SameBitsAgainAndInPieces) {
  const std::string scene = kScenes + "gas_2d.yaml --until 2 --stats ";
  ASSERT_EQ(run(scene + file("a.json")), 0);
  ASSERT_EQ(run(scene + file("b.json") + " --progress --events " + file("e.csv")), 0);
  const auto hash = [this](const char* name) {
    return YAML::LoadFile(file(name))["state_hash"].as<std::string>();
  };
  EXPECT_EQ(hash("a.json"), hash("b.json"));
  const YAML::Node stats = YAML::LoadFile(file("b.json"));
  EXPECT_EQ(rows("e.csv", kEvents).size(), stats["ball_collisions"].as<std::size_t>() +
                                               stats["wall_collisions"].as<std::size_t>());
}

TEST_F(BallSimRun, SameBitsWithAnyNumberOfThreads) {
  const std::string scene = kScenes + "gas_3d.yaml --until 1 --method continuous --stats ";
  ASSERT_EQ(run(scene + file("a.json")), 0) << err_;
  ASSERT_EQ(run(scene + file("b.json") + " --threads 2"), 0) << err_;
  EXPECT_EQ(YAML::LoadFile(file("a.json"))["state_hash"].as<std::string>(),
            YAML::LoadFile(file("b.json"))["state_hash"].as<std::string>());
}

TEST_F(BallSimRun, TakesMethodAndPrecision) {
  ASSERT_EQ(run(kScenes +
                "two_balls.yaml --until=10 --method brute_force --precision long_double "
                "--time-step 0.01 --stats " +
                file("s.json")),
            0)
      << err_;
  const YAML::Node stats = YAML::LoadFile(file("s.json"));
  EXPECT_EQ(stats["method"].as<std::string>(), "brute_force");
  EXPECT_EQ(stats["ball_collisions"].as<int>(), 1);
}

TEST_F(BallSimRun, ShowsProgressOnlyWhenAsked) {
  ASSERT_EQ(run(kScenes + "two_balls.yaml --until 1"), 0);
  EXPECT_EQ(err_, "");
  EXPECT_NE(out_.find("2 balls"), std::string::npos);
  ASSERT_EQ(run(kScenes + "two_balls.yaml --until 1 --progress"), 0);
  EXPECT_NE(err_.find("100.0 %"), std::string::npos) << err_;
}

TEST_F(BallSimRun, HelpIsComplete) {
  for (const char* option : {"--help", "-h"}) {
    ASSERT_EQ(run(option), 0);
    for (const char* word :
         {"--until", "--method", "--time-step", "--every", "--out", "--events", "--stats",
          "--precision", "--threads", "--progress", "-1 x-min", "Exit codes"}) {
      EXPECT_NE(out_.find(word), std::string::npos) << word;
    }
  }
}

TEST_F(BallSimRun, RefusesBadArguments) {
  const std::string scene = kScenes + "two_balls.yaml";
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {"", "SCENE.yaml: missing"},
      {scene, "--until: missing"},
      {scene + " --until", "--until: missing"},
      {scene + " --until 0", "--until: 0: must be a number of seconds above 0"},
      {scene + " --until -1", "--until: -1: must be"},
      {scene + " --until nan", "--until: nan: must be"},
      {scene + " --until inf", "--until: inf: must be"},
      {scene + " --until 1e99", "--until: 1e99: must be"},
      {scene + " --until 1s", "--until: 1s: must be"},
      {scene + " --until ''", "--until: '': must be"},
      {scene + " --until 1 --until 2", "--until: repeated"},
      {scene + " " + scene + " --until 1", "only one scene"},
      {scene + " --until 1 --time-step 0", "--time-step: 0: must be"},
      {scene + " --until 1 --every 0 --out o", "--every: 0: must be"},
      {scene + " --until 1 --every 1e-12 --out o", "--every: 1e-12: must not"},
      {scene + " --until 1 --every 0.1", "--every: 0.1: needs --out"},
      {scene + " --until 1 --method magic", "--method: magic: must be one of auto"},
      {scene + " --until 1 --precision half", "--precision: half: must be double or"},
      {scene + " --until 1 --threads 0", "--threads: 0: must be a whole number of threads"},
      {scene + " --until 1 --threads 1.5", "--threads: 1.5: must be"},
      {scene + " --until 1 --threads many", "--threads: many: must be"},
      {scene + " --until 1 --threads 1e9", "--threads: 1e9: must be"},
      {scene + " --until 1 --speed 3", "--speed: unknown: must be one of"},
      {scene + " --until 1 --progress=1", "--progress=1: unknown"},
      {scene + " --until 1 --out " + scene, "must not be the file given as SCENE.yaml"},
      {scene + " --until 1 --out " + file("x") + " --events " + file("x"), "given as --out"},
  };
  for (const auto& [arguments, complaint] : mistakes) {
    EXPECT_EQ(run(arguments), 2) << arguments;
    EXPECT_NE(err_.find(complaint), std::string::npos) << arguments << "\n" << err_;
    EXPECT_EQ(out_, "");
  }
}

TEST_F(BallSimRun, RefusesBadScenesAndOutputs) {
  EXPECT_EQ(run(file("none.yaml") + " --until 1"), 2);
  EXPECT_NE(err_.find("none.yaml: cannot be read"), std::string::npos) << err_;

  const std::string bad = write("bad.yaml", "restitution: 2\n");
  write("kept.csv", "precious");
  EXPECT_EQ(run(bad + " --until 1 --out " + file("kept.csv")), 2);
  EXPECT_NE(err_.find("bad.yaml:1: restitution: 2: must be within 0..1"), std::string::npos);
  EXPECT_EQ(read("kept.csv"), "precious") << "nothing is overwritten for a bad scene";

  const std::string crowded = write("crowded.yaml",
                                    "box: {min: [0, 0, 0], max: [1, 1, 1]}\n"
                                    "fill: [{count: 100, radius: 0.2, mass: 1}]\n");
  EXPECT_EQ(run(crowded + " --until 1"), 2);
  EXPECT_NE(err_.find("of 100 balls"), std::string::npos) << err_;

  for (const char* option : {"--out", "--events", "--stats"}) {
    EXPECT_EQ(run(kScenes + "two_balls.yaml --until 1 " + option + " " + file("no/such/o")), 2);
    EXPECT_NE(err_.find("no/such/o: cannot be written: No such file"), std::string::npos) << err_;
    if (std::string(option) == "--stats") continue;  // written at the end
    EXPECT_EQ(run(kScenes + "two_balls.yaml --until 1 " + option + " /dev/full"), 2);
    EXPECT_NE(err_.find("/dev/full: cannot be written"), std::string::npos) << err_;
  }
}

TEST_F(BallSimRun, TellsWhenADiskRunsFull) {
  EXPECT_EQ(run(kScenes + "two_balls.yaml --until 1 --stats /dev/full"), 3);
  EXPECT_NE(err_.find("/dev/full: cannot be written"), std::string::npos) << err_;
}

TEST_F(BallSimRun, InterruptedItKeepsWhatItReached) {
  // Far more to simulate than a second of wall-clock time allows: 10^6 s of a dense gas.
  const std::string arguments = kScenes + "gas_3d.yaml --until 1e6 --out '" + file("o.csv") +
                                "' --stats '" + file("s.json") + "'";
  const std::string command = std::string("timeout --preserve-status -s INT 1 '") + BALL_SIM_RUN +
                              "' " + arguments + " 2> '" + file("stderr") + "'";
  const int status = std::system(command.c_str());
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 3);
  EXPECT_NE(read("stderr").find("interrupted"), std::string::npos);
  EXPECT_EQ(rows("o.csv", kStates).size(), 2000u);  // start, and where it was stopped
  EXPECT_LT(YAML::LoadFile(file("s.json"))["reached"].as<double>(), 1e6);
}

}  // namespace
