#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/class_table.h"
#include "mapping/evaluation/evaluate_geometry.h"
#include "mapping/evaluation/evaluate_labels.h"

namespace felt::apps {

// Figures of an evaluation as JSON, and what each of them is (docs/evaluation.md). Figures that do not exist are null.

nlohmann::ordered_json geometry_json(const GeometryScores& scores);
nlohmann::ordered_json geometry_definitions(const GeometryOptions& options, bool with_cameras);

/// `labels`: accuracies and IoU with the confusion matrix; `calibration` and `class_images` where there are any.
nlohmann::ordered_json label_json(const LabelScores& scores, const ClassTable& classes);
/// `what_counts`: "a pixel" or "a sample", for the words.
nlohmann::ordered_json label_definitions(const LabelScores& scores, const std::string& what_counts);

nlohmann::ordered_json property_json(const PropertyScores& scores);
nlohmann::ordered_json property_definitions();

}  // namespace felt::apps
