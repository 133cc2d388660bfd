#pragma once

namespace CLI {
class App;
}

namespace felt::apps {

// Each adds one subcommand; it lives in apps/commands/<command>.cpp and is called from apps/main.cpp, in the order of
// `--help`.
void add_reconstruct(CLI::App& app);
void add_doctor(CLI::App& app);
void add_segment(CLI::App& app);
void add_info(CLI::App& app);
void add_convert(CLI::App& app);
void add_export(CLI::App& app);
void add_render(CLI::App& app);
void add_evaluate(CLI::App& app);
void add_calibrate_labels(CLI::App& app);
void add_touch(CLI::App& app);
void add_region(CLI::App& app);
void add_query(CLI::App& app);
void add_suggest(CLI::App& app);
void add_friction(CLI::App& app);
void add_merge(CLI::App& app);
void add_diff(CLI::App& app);
void add_verify(CLI::App& app);
void add_infer(CLI::App& app);
void add_bench(CLI::App& app);
void add_simulate(CLI::App& app);

}  // namespace felt::apps
