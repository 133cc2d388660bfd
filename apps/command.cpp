#include "apps/command.h"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <tbb/global_control.h>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include <thread>

#include "apps/exit_code.h"
#include "io/files/json_text.h"

namespace felt::apps {
namespace {

void log_to_stderr(const std::string& level) {
  auto logger = std::make_shared<spdlog::logger>("feltmap", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern("%n: %l: %v");
  logger->set_level(spdlog::level::from_str(level));
  spdlog::set_default_logger(logger);
}

std::string indented(const std::string& lines) {
  std::string text = "  ";
  for (const char c : lines) {
    text += c;
    if (c == '\n') text += "  ";
  }
  return text;
}

}  // namespace

int CommonOptions::thread_count() const {
  return threads > 0 ? threads : std::max(1, int(std::thread::hardware_concurrency()));
}

CLI::App& add_command(CLI::App& app, const CommandText& text, CommonOptions& common, std::function<int()> run) {
  CLI::App& command = *app.add_subcommand(text.name, text.description);
  command.footer("Example:\n" + indented(text.example));
  command.add_flag("--quiet", common.quiet, "No progress bar and no summary")->group("Common");
  command.add_flag("--json", common.json, "Print one JSON document on stdout and nothing else there")->group("Common");
  command.add_option("--threads", common.threads, "Threads to use; 0: all of them")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str()
      ->group("Common");
  command.add_option("--log-level", common.log_level, "Messages on stderr")
      ->check(CLI::IsMember({"trace", "debug", "info", "warn", "error", "off"}))
      ->capture_default_str()
      ->group("Common");
  command.callback([&common, run = std::move(run)] {
    log_to_stderr(common.log_level);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(common.thread_count()));
    // CLI11's own way to give an exit code from a callback; it prints nothing.
    if (const int code = run(); code != kDone) throw CLI::RuntimeError(code);
  });
  return command;
}

CLI::Option* add_switch(CLI::App& command, const std::string& name, std::optional<bool>& value, const std::string& text,
                        bool meaning) {
  // Checked before CLI11 converts it, which throws what is no usage error.
  const auto is_switch = [](const std::string& word) {
    try {
      CLI::detail::to_flag_value(word);
      return std::string();
    } catch (const std::logic_error&) {
      return "expected true or false, found '" + word + "'";
    }
  };
  return command
      .add_flag_function(
          name, [&value, meaning](int64_t count) { value = (count > 0) == meaning; }, text)
      ->check(is_switch);
}

void print_json(const nlohmann::ordered_json& document) { std::printf("%s\n", json_text(document, 2).c_str()); }

}  // namespace felt::apps
