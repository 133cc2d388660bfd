#include "apps/output/evaluation_report.h"

#include <cmath>

namespace felt::apps {
namespace {
using Json = nlohmann::ordered_json;

Json number(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

Json calibration_json(const CalibrationScores& s) {
  Json json;
  json["predictions"] = s.count();
  json["refused"] = s.refused();
  json["ece"] = number(s.ece());
  json["brier"] = number(s.brier());
  json["nll"] = number(s.nll());
  json["bins"] = Json::array();
  for (int i = 0; i < CalibrationScores::kBins; ++i) {
    const CalibrationScores::Bin& bin = s.bins()[size_t(i)];
    const auto n = double(bin.count);
    json["bins"].push_back({{"from", double(i) / CalibrationScores::kBins},
                            {"to", double(i + 1) / CalibrationScores::kBins},
                            {"predictions", bin.count},
                            {"confidence", number(bin.confidence_sum / n)},
                            {"accuracy", number(double(bin.correct) / n)}});
  }
  return json;
}

}  // namespace

Json geometry_json(const GeometryScores& s) {
  Json json;
  json["samples"] = {{"reconstruction", s.samples_reconstruction}, {"reference", s.samples_reference}};
  json["reference_seen"] = s.reference_seen;
  json["reconstruction_seen"] = s.reconstruction_seen;
  json["accuracy_m"] = {{"mean", s.accuracy_mean_m}, {"median", s.accuracy_median_m}, {"rms", s.accuracy_rms_m}};
  json["completion_m"] = {{"mean", s.completion_mean_m}, {"median", s.completion_median_m}};
  json["precision"] = s.precision;
  json["recall"] = s.recall;
  json["f_score"] = s.f_score;
  json["normal_consistency"] = s.normal_consistency;
  return json;
}

Json geometry_definitions(const GeometryOptions& options, bool with_cameras) {
  const std::string threshold = Json(options.threshold_m).dump() + " m";
  Json json;
  json["samples"] = "points spread evenly over the area of each mesh (stratified, seed " +
                    std::to_string(options.seed) + "); distances are exact, to the nearest triangle";
  json["accuracy"] =
      "distance of a sample of the reconstruction to the reference, metres: mean, median, root mean square";
  json["completion"] = "distance of a sample of the reference to the reconstruction, metres: mean, median";
  json["precision"] = "share of samples of the reconstruction nearer than " + threshold + " to the reference";
  json["recall"] =
      "completion ratio: share of samples of the reference nearer than " + threshold + " to the reconstruction";
  json["f_score"] = "harmonic mean of precision and recall";
  json["normal_consistency"] =
      "mean |n . n'| of the triangle normals at a sample and at its nearest point, mean of both directions";
  json["reference_seen"] = with_cameras
                               ? "share of the reference's samples inside the image and depth range of a camera of the "
                                 "trajectory and first on its ray against the reference; only these count"
                               : "1: every sample of the reference counts (no trajectory given)";
  json["reconstruction_seen"] = with_cameras && options.cull_reconstruction
                                    ? "share of the reconstruction's samples that pass the same test; only these count"
                                    : "1: every sample of the reconstruction counts";
  return json;
}

Json label_json(const LabelScores& scores, const ClassTable& classes) {
  const LabelCounts& n = scores.counts;
  Json json, labels;
  labels["views"] = scores.views;
  labels["counted"] = n.total();
  labels["foreign"] = scores.foreign;
  labels["accuracy"] = number(n.pixel_accuracy());
  labels["mean_accuracy"] = number(n.mean_recall());
  labels["mean_iou"] = number(n.mean_iou());
  labels["mean_iou_true_or_predicted"] = number(n.mean_iou_of_all());
  labels["classes"] = Json::array();
  labels["confusion"] = Json::array();
  for (int c = 0; c < n.classes(); ++c) {
    uint64_t row = 0;
    Json counts = Json::array();
    for (int p = 0; p < n.classes(); ++p) counts.push_back(n.count(c, p)), row += n.count(c, p);
    counts.push_back(n.without_prediction(c)), row += n.without_prediction(c);
    const ClassInfo& info = classes.at_slot(c);
    labels["classes"].push_back({{"id", info.id},
                                 {"name", info.name},
                                 {"counted", row},
                                 {"accuracy", number(n.recall(c))},
                                 {"precision", number(n.precision(c))},
                                 {"iou", number(n.iou(c))}});
    labels["confusion"].push_back(std::move(counts));
  }
  json["labels"] = std::move(labels);
  if (scores.calibration.count() > 0) json["calibration"] = calibration_json(scores.calibration);
  if (scores.images.images() > 0)
    json["class_images"] = {{"images", scores.images.images()},
                            {"psnr_db", number(scores.images.psnr_db())},
                            {"ssim", number(scores.images.ssim())},
                            {"binary_cross_entropy", number(scores.images.binary_cross_entropy())}};
  return json;
}

Json label_definitions(const LabelScores& scores, const std::string& what_counts) {
  Json json;
  json["counted"] = what_counts;
  json["foreign"] = "the same of a class that the evaluated classes do not have (matched by name): left out";
  json["accuracy"] = "share of what is counted whose predicted class is the true one; no prediction is wrong";
  json["mean_accuracy"] = "mean of the classes' accuracy over the classes that occur in the truth";
  json["mean_iou"] =
      "mean of the classes' intersection over union over the classes that occur in the truth: one that occurs and is "
      "never found counts as 0, one that does not occur is left out even where it is predicted";
  json["mean_iou_true_or_predicted"] =
      "the same over the classes that occur in the truth or are predicted: one that is only predicted counts as 0";
  json["classes"] =
      "accuracy: TP / (TP + FN); precision: TP / (TP + FP); iou: TP / (TP + FP + FN); null where the denominator is 0";
  json["confusion"] =
      "counts; a row a true class, a column a predicted class, both in the order of `classes`; the last column: no "
      "prediction";
  if (scores.calibration.count() > 0) {
    json["calibration"] =
        "over what is counted and has class probabilities (the expected class probabilities of the voxel, prior "
        "included); refused: probabilities that are negative, not finite or do not sum to 1";
    json["ece"] =
        "expected calibration error: over 15 bins of equal width of the largest probability, (i/15, (i+1)/15], the sum "
        "of the share of predictions times |mean confidence - accuracy| (Guo et al. 2017)";
    json["brier"] =
        "mean of the squared distance of the probabilities to the one-hot truth, summed over classes: 0 to 2";
    json["nll"] = "mean of -ln p(true class), nats; p not below 1e-12";
  }
  if (scores.images.images() > 0)
    json["class_images"] =
        "one image of p(class) for each class that occurs in the truth of a view, against 1 where the class is and 0 "
        "elsewhere; pixels that are not counted are 0 in both. psnr_db: 10 log10(1 / mean squared difference) over all "
        "pixels of all images; ssim: mean of the structural similarity (11 x 11 Gaussian window, sigma 1.5, K1 .01, "
        "K2 .03; Wang et al. 2004) over images; binary_cross_entropy: mean over all pixels of all images, nats, p kept "
        "within [1e-7, 1 - 1e-7]";
  return json;
}

Json property_json(const PropertyScores& s) {
  return {{"readings", s.count()},
          {"mae", number(s.mae())},
          {"nll", number(s.nll())},
          {"crps", number(s.crps())},
          {"coverage_50", number(s.coverage(0))},
          {"coverage_90", number(s.coverage(1))}};
}

Json property_definitions() {
  return {{"readings", "as recorded: their own noise (sigma) is not added to the forecasts"},
          {"mae", "mean |location of the forecast - reading|; the location is the forecast's mean where that exists"},
          {"nll", "mean of -ln of the forecast's density at the reading, nats (depends on the unit)"},
          {"crps",
           "continuous ranked probability score, unit of the property: twice the mean pinball loss over 200 quantiles "
           "(Gneiting and Raftery 2007)"},
          {"coverage_50", "share of readings within the forecast's central 50 % interval"},
          {"coverage_90", "share of readings within the forecast's central 90 % interval"}};
}

}  // namespace felt::apps
