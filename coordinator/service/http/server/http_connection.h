// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Connections of clients to the HTTP port, in lists by state, so that connections without a request
// in progress can be closed when places run out. Internal to http_server.cc.
#pragma once

#include <utility>  // Before asio of Boost 1.74, which uses std::exchange unasked.

#include <boost/asio/ip/tcp.hpp>
#include <cstddef>
#include <list>
#include <map>
#include <string>

#include "coordinator/access/peer_network.h"
#include "coordinator/service/http/server/http_stream.h"

namespace sheaf::coordinator {

namespace asio = boost::asio;
namespace beast = boost::beast;
using asio::ip::tcp;
using boost::system::error_code;

struct Connection;
// Connections in the same state, those that have been in it longest first.
using ConnectionList = std::list<Connection*>;

// The number of connections, in total and by address (PeerNetwork).
struct ConnectionCounts {
  size_t all = 0;
  std::map<std::string, size_t> of_peer;
};

// A client's socket during its coroutine, and its place in a list. Socket thread only.
struct Connection {
  // tls: null for a plain connection.
  Connection(tcp::socket socket, asio::ssl::context* tls, ConnectionCounts* all)
      : stream(std::move(socket), tls), counts(all) {
    error_code ignored;
    address = stream.socket().remote_endpoint(ignored).address().to_string();
    peer = PeerNetwork(address);
    stream.socket().set_option(tcp::no_delay(true), ignored);
    ++counts->all;
    ++counts->of_peer[peer];
  }
  ~Connection() {
    MoveTo(nullptr);
    --counts->all;
    const auto of_peer = counts->of_peer.find(peer);
    if (--of_peer->second == 0) counts->of_peer.erase(of_peer);
  }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  // Moves the connection from its list to the end of `next`; null: to none.
  void MoveTo(ConnectionList* next) {
    if (list != nullptr) list->erase(place);
    list = next;
    if (list != nullptr) place = list->insert(list->end(), this);
  }

  HttpStream stream;
  std::string address;
  std::string peer;  // Its address or network (PeerNetwork).
  ConnectionCounts* const counts;
  ConnectionList* list = nullptr;
  ConnectionList::iterator place;
};

// Closes the first connection of the list, which ends its coroutine. Returns false if the list is
// empty.
inline bool DropOldest(const ConnectionList& list) {
  if (list.empty()) return false;
  Connection* const oldest = list.front();
  oldest->MoveTo(nullptr);
  oldest->stream.close();
  return true;
}

}  // namespace sheaf::coordinator
