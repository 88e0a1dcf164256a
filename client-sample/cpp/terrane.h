// All of the client library in one include: <terrane/terrane.h> where it is installed.
#pragma once

#include "client-sample/cpp/chunk_reader.h"
#include "client-sample/cpp/client.h"
#include "client-sample/cpp/column_map.h"
#include "client-sample/cpp/terrain.h"
#include "client-sample/cpp/view_set.h"
#include "generator/volume/color.h"
