// SPDX-License-Identifier: BSD-3-Clause
#include "plugin/commands.h"

#include "plugin/network_program.h"

namespace vgtw {

const std::vector<Command>& Commands() {
  static const std::vector<Command> commands = {
      {"doctor", "What is here, what works, what to install", DeclareDoctor},
      {"demo",
       "Make photos with moving distractors and reconstruct them, with and without masks",
       DeclareDemo,
       "  vgtw demo --output_path demo/"},
      {"import",
       "Other systems' poses and depths -> predictions folder",
       DeclareImport,
       "  vgtw import --input_path vggt/sparse --image_path photos/ --output_path predictions/\n"
       "  vgtw import --input_path predictions.npz --image_path photos/ --output_path "
       "predictions/"},
      {"predict", kPredictSummary, {}, {}, BecomeNetworkProgram},
      {"mask", "Tools for distractor masks"},
      {"mask make",
       "Predictions -> COLMAP masks",
       DeclareMaskMake,
       "  vgtw mask make --predictions_path predictions/ --output_path masks/ --dilate_px 10"},
      {"mask lint",
       "What COLMAP would do with each mask, and what is wrong with it",
       DeclareMaskLint,
       "  vgtw mask lint --image_path photos/ --mask_path masks/ --database_path a.db\n"
       "  vgtw mask lint --image_path photos/ --mask_path masks/ --fix mended_masks/"},
      {"mask convert",
       "Masks of one tool -> masks of another",
       DeclareMaskConvert,
       "  vgtw mask convert --list\n"
       "  vgtw mask convert --image_path photos/ --mask_path masks/ --from colmap --to openmvs "
       "--output_path openmvs_masks/"},
      {"mask apply",
       "Take distractors out of an existing COLMAP database",
       DeclareMaskApply,
       "  vgtw mask apply --database_path a.db --mask_path masks/ --output_path b.db\n"
       "  vgtw mask apply --database_path a.db --mask_path masks/ --output_path b.db --rule "
       "keypoints --input_path sparse/0 --model_output_path static/"},
      {"mask restore",
       "Undo mask apply: every row as it was",
       DeclareMaskRestore,
       "  vgtw mask restore --database_path b.db --in_place"},
      {"mask undistort",
       "Masks of photos -> masks of the images that colmap image_undistorter wrote",
       DeclareMaskUndistort,
       "  vgtw mask undistort --mask_path masks/ --input_path sparse/0 --undistorted_path dense/ "
       "--output_path dense/masks"},
      {"mask score",
       "Masks against true masks: F1, IoU, boundary F, features left and lost; also `evaluate "
       "masks`",
       DeclareMaskScore,
       "  vgtw mask score --mask_path masks/ --reference_mask_path truth/ --database_path a.db"},
      {"mask preview",
       "Photos with what their masks exclude, as a picture",
       DeclareMaskPreview,
       "  vgtw mask preview --image_path photos/ --mask_path masks/ --output_path preview.jpg"},
      {"mask vote",
       "Masks of predictions mended by the depths of the other views",
       DeclareMaskVote,
       "  vgtw mask vote --predictions_path predictions/ --output_path voted/\n"
       "  vgtw mask make --predictions_path voted/ --output_path masks/"},
      {"match",
       "Photos or a database, and predictions -> database with matches",
       DeclareMatch,
       "  vgtw match --image_path photos/ --mask_path masks/ --predictions_path predictions/ "
       "--output_path a.db\n"
       "  vgtw match --database_path a.db --predictions_path predictions/ --output_path b.db"},
      {"seed",
       "Predictions (and database) -> COLMAP model",
       DeclareSeed,
       "  vgtw seed --predictions_path predictions/ --image_path photos/ --output_path sparse/\n"
       "  vgtw seed --predictions_path predictions/ --database_path a.db --output_path seed/"},
      {"refine",
       "COLMAP model (and database) -> refined model, never worse than it was",
       DeclareRefine,
       "  vgtw refine --input_path seed/ --database_path a.db --output_path refined/\n"
       "  vgtw refine --input_path sparse/0 --output_path refined/"},
      {"run",
       "Photos and predictions -> masks, database, refined COLMAP model, report",
       DeclareRun,
       "  vgtw run --image_path photos/ --predictions_path predictions/ --output_path out/"},
      {"compare",
       "Models side by side, per photo: did it help, and where not? Tables and report.html",
       DeclareCompare,
       "  vgtw compare out/sparse/feedforward out/sparse/refined --database_path out/database.db "
       "--image_path photos/ --output_path report.html\n"
       "  vgtw compare seed/ refined/ colmap/sparse/0 --reference_path truth/ --csv_path "
       "figures.csv"},
      {"evaluate", "Poses, points, depths and masks against a reference, as numbers"},
      {"evaluate pose",
       "ATE, RPE, RRA, RTA, AUC and the errors of each view",
       DeclareEvaluatePose,
       "  vgtw evaluate pose --input_path sparse/0 --reference_path truth/sparse\n"
       "  vgtw evaluate pose --input_path slam.txt --reference_path groundtruth.txt --alignment "
       "se3 --robust"},
      {"evaluate points",
       "Clouds: accuracy, completeness, normal consistency, F",
       DeclareEvaluatePoints,
       "  vgtw evaluate points --input_path predictions/ --reference_path truth/\n"
       "  vgtw evaluate points --input_path out/points.ply --reference_path scan.ply --icp "
       "similarity"},
      {"evaluate depth",
       "Depths: AbsRel and delta < 1.25, reprojected or as maps",
       DeclareEvaluateDepth,
       "  vgtw evaluate depth --input_path predictions/ --reference_path truth/\n"
       "  vgtw evaluate depth --input_path predictions/ --reference_path truth/ --method maps "
       "--keep_percent 100"},
      {"evaluate masks",
       "Masks: F1, IoU, boundary F, features left and lost; also `mask score`",
       DeclareMaskScore,
       "  vgtw evaluate masks --mask_path masks/ --reference_mask_path truth/ --database_path "
       "a.db"},
      {"protocol", "The paper's tables: photos, conditions, measuring, LaTeX"},
      {"protocol make",
       "A data set's folder -> protocol file: which photos, under which conditions",
       DeclareProtocolMake,
       "  vgtw protocol make --dataset robustnerf --input_path robustnerf/ --output_path "
       "protocol.json\n"
       "  vgtw protocol make --dataset folder --input_path scenes/ --num_images 8 --seed 1 "
       "--output_path protocol.json"},
      {"protocol photos",
       "The protocol's photos in folders for any system, and the commands to run",
       DeclareProtocolPhotos,
       "  vgtw protocol photos --protocol_path protocol.json --output_path photos/"},
      {"protocol tables",
       "Predictions of systems and pseudo ground truth -> the paper's tables: JSON, CSV, LaTeX",
       DeclareProtocolTables,
       "  vgtw protocol tables --protocol_path protocol.json --reference_path reference/ --system "
       "VGGT=vggt/ --system VGTW=vgtw/ --output_path tables/"},
      {"protocol times",
       "Seconds of a network for 5, 10 and 20 views, beside the paper's",
       DeclareProtocolTimes,
       "  vgtw protocol times --image_path photos/ --weights_path vgtw.safetensors --output_path "
       "times/"},
      {"export",
       "Cameras, points and depths for other programs: PLY, PCD, glTF, transforms.json, TUM, "
       "KITTI, "
       "COLMAP",
       DeclareExport,
       "  vgtw export --input_path out/sparse/refined --format transforms --output_path "
       "transforms.json\n"
       "  vgtw export --input_path predictions/ --format tum --label name --output_path poses.txt\n"
       "  vgtw export --input_path predictions/ --image_path photos/ --output_path dense.ply\n"
       "  vgtw export --input_path predictions/ --format colmap_depth --model_path "
       "out/sparse/refined --output_path dense/"},
      {"probe", kProbeSummary, {}, {}, BecomeNetworkProgram},
      {"dataset", "Photos and masks to train on: what is wrong, figures, wrong labels on purpose"},
      {"dataset check",
       "What the trainer would stop at, or learn badly from",
       DeclareDatasetCheck,
       "  vgtw dataset check --image_path scenes/ --mask_path masks/ --width 518 --height 392"},
      {"dataset stats",
       "Photos, sizes and distractors per scene, in pixels and in the network's patches",
       DeclareDatasetStats,
       "  vgtw dataset stats --image_path scenes/ --mask_path masks/ --json stats.json"},
      {"dataset corrupt",
       "A copy of the masks of which a share is all static, to test what wrong labels do",
       DeclareDatasetCorrupt,
       "  vgtw dataset corrupt --image_path scenes/ --mask_path masks/ --share 0.1 --output_path "
       "dirty_masks/"},
      {"train", kTrainSummary, {}, {}, BecomeNetworkProgram},
      {"weights", kWeightsSummary},
      {"weights inspect", kWeightsInspectSummary, {}, {}, BecomeNetworkProgram},
      {"weights check", kWeightsCheckSummary, {}, {}, BecomeNetworkProgram},
      {"weights convert", kWeightsConvertSummary, {}, {}, BecomeNetworkProgram},
  };
  return commands;
}

}  // namespace vgtw
